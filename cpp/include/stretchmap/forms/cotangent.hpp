// Cotangent weights of a triangle mesh.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::forms {

// \return (e) weights (3.2): half the sum of the cotangents of the angles opposite to each edge.
// \throws Error "DegenerateError" with the face ids when a face has no area.
Vec cotangent_weights(const mesh::SurfaceTopology& top, const PointsRef& points);

// \param weights (e)
// \return (n, n) weighted Laplacian: sum of weights on the diagonal, minus the weight off it;
//         positive semi-definite for cotangent weights, so the negative of what some libraries
//         have.
SparseMatrix weighted_laplacian(const mesh::SurfaceTopology& top, const VecRef& weights);

}  // namespace stretchmap::forms
