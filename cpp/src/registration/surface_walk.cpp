#include "stretchmap/registration/surface_walk.hpp"

#include <cmath>

namespace stretchmap::registration {

bool SurfaceWalk::point(const Eigen::RowVector2d& y, Eigen::RowVector3d& x) const {
  const ChartLocator::Hit hit = locator.find(y.transpose());
  if (hit.face < 0) return false;
  x.setZero();
  for (int k = 0; k < 3; ++k) x += hit.weights[k] * points.row(faces(hit.face, k));
  return true;
}

Eigen::Matrix2d SurfaceWalk::steps(const Eigen::RowVector2d& y) const {
  const ChartLocator::Hit hit = locator.find(y.transpose());
  if (hit.face < 0) return Eigen::Matrix2d::Zero();
  const auto row = slopes.row(hit.face);
  Eigen::Matrix<double, 3, 2> J;
  J << row[0], row[1], row[2], row[3], row[4], row[5];
  const Eigen::Matrix2d metric = J.transpose() * J;
  // metric = L L^T: the columns of L^-T have unit length on the face and are orthogonal there.
  const double a = std::sqrt(metric(0, 0)), b = metric(1, 0) / a;
  const double c = std::sqrt(metric(1, 1) - b * b);
  Eigen::Matrix2d inverse;
  inverse << 1.0 / a, -b * (1.0 / c) / a, 0.0, 1.0 / c;
  return inverse;
}

}  // namespace stretchmap::registration
