#include "stretchmap/volume/rest_shape.hpp"

#include <cmath>

#include "stretchmap/volume/signed_svd.hpp"

namespace stretchmap::volume {

Rows rest_matrices(const PointsRef& V, const TetsRef& tets, double max_aspect) {
  using Eigen::Matrix3d;
  Matrix3d regular;  // edge matrix of a regular tet
  regular << 1.0, 0.5, 0.5, 0.0, std::sqrt(3.0) / 2.0, std::sqrt(3.0) / 6.0, 0.0, 0.0,
      std::sqrt(2.0 / 3.0);
  const Matrix3d regular_inverse = regular.inverse();
  const Index k = static_cast<Index>(tets.rows());
  Rows rest(k, 9);
#pragma omp parallel for schedule(static)
  for (Index t = 0; t < k; ++t) {
    Matrix3d edges;
    for (int a = 1; a < 4; ++a) edges.col(a - 1) = V.row(tets(t, a)) - V.row(tets(t, 0));
    const SignedSvd svd = signed_svd(edges * regular_inverse);
    const double floor = svd.sigma[0] / max_aspect;
    Matrix3d shape = edges;
    if (svd.sigma[2] < floor) {
      const Eigen::Vector3d clamped = svd.sigma.cwiseMax(floor);
      const double scale = std::cbrt(svd.sigma.prod() / clamped.prod());
      shape = svd.U * (scale * clamped).asDiagonal() * svd.V.transpose() * regular;
    }
    const Matrix3d inverse = shape.inverse();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) rest(t, 3 * i + j) = inverse(i, j);
  }
  return rest;
}

}  // namespace stretchmap::volume
