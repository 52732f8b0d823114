#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

// \param edges the edges of a triangle from its first corner, as columns, counterclockwise.
// \param max_aspect largest ratio of the singular values of the map from an equilateral triangle.
// \return the edges of the closest triangle of that ratio and the same area; `edges` themselves
//         where the ratio is not exceeded.
Eigen::Matrix2d rounded_triangle(const Eigen::Matrix2d& edges, double max_aspect);

}  // namespace stretchmap::mesh
