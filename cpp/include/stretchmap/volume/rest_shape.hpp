// Reference shapes of the tets for the element energy.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::volume {

// Matrices S_t (k, 9), row-major, such that J_t = [x1 - x0, x2 - x0, x3 - x0] S_t has det J_t equal
// to the ratio of image to rest volume.
//
// For a well-shaped tet S_t is the inverse of its edge matrix, so J_t is the Jacobian of the map.
// The shape of a sliver is no shape to be kept: relative to the regular tet its singular values are
// clamped so that the largest is at most `max_aspect` times the smallest, and the result is
// rescaled to the tet's own volume. Only the shape term sees the difference. \pre all signed
// volumes positive, max_aspect >= 1.
Rows rest_matrices(const PointsRef& V, const TetsRef& tets, double max_aspect);

}  // namespace stretchmap::volume
