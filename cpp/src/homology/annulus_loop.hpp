// Shortest loop round the annulus that a torus becomes when it is cut along a loop.
#pragma once

#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

// The shortest loop of edges that is homotopic to `cut` in the surface cut open along it, `cut`
// itself if none is shorter.
//
// With P a shortest path from one border of the annulus to the other, some shortest loop meets P in
// one vertex or one stretch. So for every vertex of P the shortest path is searched from its left
// copy to its right copy in the disk that is left when the annulus is cut along P, by A* with the
// distance to the right copies of all of P as estimate. Vertices that the estimate, or the length
// through another vertex of P less twice the distance, shows to be too far are spared.
// \pre    genus one, `cut` a simple loop that does not separate.
Loop shortest_in_annulus(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                         const Loop& cut, const Poll& poll = {});

}  // namespace stretchmap::homology
