// First cohomology of a tet mesh, evaluated on loops.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

// H^1(M; Z) is the kernel of `relations`: a vector x in Z^k with relations x = 0 is a closed
// integer 1-form of the tet mesh, up to exact ones, and its integrals over the loops are
// `loop_values` x.
struct SolidCohomology {
  IndexRows relations;    // (r, k)
  IndexRows loop_values;  // (number of loops, k)
};

// A closed 1-form that vanishes on a spanning tree of the edges is carried from edge to edge by the
// triangles: two known sides give the third. Where that stops, the next edge gets an unknown of its
// own. Triangles whose sides are all known and do not sum to zero are the relations.
// \param edges (e, 2) edges of the tets, lower id first, in lexicographic order
// \param loops vertex ids of the tet mesh, consecutive ones joined by an edge
// \throws Error "ArrayError" for a loop that leaves the edges, "ConnectivityError" when the tets
//         are not connected.
SolidCohomology solid_cohomology(const TetsRef& tets, const EdgesRef& edges, Index n_vertices,
                                 const std::vector<Loop>& loops, const Poll& poll = {});

}  // namespace stretchmap::homology
