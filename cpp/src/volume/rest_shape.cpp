#include "stretchmap/volume/rest_shape.hpp"

#include <cmath>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/volume/signed_svd.hpp"

namespace stretchmap::volume {
namespace {

using Eigen::Matrix3d;

// Edge matrix of a regular tet.
Matrix3d regular_edges() {
  Matrix3d regular;
  regular << 1.0, 0.5, 0.5, 0.0, std::sqrt(3.0) / 2.0, std::sqrt(3.0) / 6.0, 0.0, 0.0,
      std::sqrt(2.0 / 3.0);
  return regular;
}

// Whether no singular value is less than the largest / max_aspect, seen without computing them: the
// least is the determinant over the others' product, which is at most half their sum of squares.
bool surely_even(const Matrix3d& stretch, double max_aspect) {
  const double size = stretch.norm();
  return 2.0 * stretch.determinant() * max_aspect >= 1.01 * size * size * size;
}

}  // namespace

Rows rest_matrices(const PointsRef& V, const TetsRef& tets, double max_aspect) {
  const Matrix3d regular = regular_edges(), regular_inverse = regular.inverse();
  const Index k = static_cast<Index>(tets.rows());
  Rows rest(k, 9);
  for_rows(k, kElementChunk, [&](Index t) {
    Matrix3d edges;
    for (int a = 1; a < 4; ++a) edges.col(a - 1) = V.row(tets(t, a)) - V.row(tets(t, 0));
    Matrix3d shape = edges;
    if (const Matrix3d stretch = edges * regular_inverse; !surely_even(stretch, max_aspect)) {
      const SignedSvd svd = signed_svd(stretch);
      const double floor = svd.sigma[0] / max_aspect;
      if (svd.sigma[2] < floor) {
        const Eigen::Vector3d clamped = svd.sigma.cwiseMax(floor);
        const double scale = std::cbrt(svd.sigma.prod() / clamped.prod());
        shape = svd.U * (scale * clamped).asDiagonal() * svd.V.transpose() * regular;
      }
    }
    const Matrix3d inverse = shape.inverse();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) rest(t, 3 * i + j) = inverse(i, j);
  });
  return rest;
}

}  // namespace stretchmap::volume
