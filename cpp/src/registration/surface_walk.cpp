#include "stretchmap/registration/surface_walk.hpp"

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
  return metric.llt().matrixU().solve(Eigen::Matrix2d::Identity());
}

}  // namespace stretchmap::registration
