#pragma once

#include <Eigen/Core>

namespace stretchmap::area {

// \return twice the signed area of the triangle 0, a, b.
inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace stretchmap::area
