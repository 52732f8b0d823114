// Intrinsic Delaunay triangulation of a surface: same vertices, same metric, no negative weight.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::forms {

struct IntrinsicDelaunay {
  Edges edges;        // (e, 2) not sorted; an edge may join a vertex to itself
  Vec weights;        // (e) cotangent weights (3.2) of the flipped triangulation, not negative
  IndexRows eta;      // (k, e) the closed forms along the new edges
  Index n_flips = 0;  // flips made
};

// Flips edges of the unfolded surface until every edge has cot + cot >= 0. Closed forms go along:
// a new diagonal gets the sum over two sides of its quadrilateral.
// \pre    closed surface, no face without area; eta (k, e) closed.
// \throws Error "SolverError" when rounding keeps the flips from ending (needle triangles).
IntrinsicDelaunay intrinsic_delaunay(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                                     const Eigen::Ref<const IndexRows>& eta);

}  // namespace stretchmap::forms
