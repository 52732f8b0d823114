// Shortest loop of edges in a homology class.
#pragma once

#include <cstdint>
#include <limits>

#include "stretchmap/base/types.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

// The shortest closed walk along edges whose period over form i is target[i].
//
// Every loop of the class has to pass through a vertex of a loop that it crosses algebraically.
// From such a vertex balls are searched in the universal abelian cover (a vertex and a sheet in
// Z^k, the sheet changing by the forms along each edge); where a ball meets its translate by the
// target, the shortest loop of the class through the vertex closes at twice the radius.
//
// Genus one: where that loop L is simple, some shortest loop of all does not cross it. (In the
// plane that covers the torus the lifts of both are lines; wherever the shortest passes L on the
// side that does not meet the lift of L's first vertex, L is as short.) The rest is a search in the
// annulus that is left when the torus is cut along L.
//
// Otherwise further vertices of `crossing` are searched from. The shortest length through a vertex
// changes at most by twice the distance between vertices, which spares most of them.
//
// The result is exact either way.
// \param edge_length (e) positive
// \param forms       (k, e) integer closed 1-forms, a basis of H^1
// \param target      (k) not zero
// \param limit       only a shorter loop is looked for; where there is none, the answer is empty
// \param crossing    a loop with non-zero intersection number with the class
// \param most_settled nodes of the cover, whose number can grow exponentially with the genus; the
//                    answer is empty where more would have to be settled, too
// \throws Error "SolverError" when no loop of the class passes through `crossing`.
Loop shortest_loop(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                   const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target,
                   const Loop& crossing, const Poll& poll = {},
                   double limit = std::numeric_limits<double>::infinity(),
                   std::int64_t most_settled = std::numeric_limits<std::int64_t>::max());

}  // namespace stretchmap::homology
