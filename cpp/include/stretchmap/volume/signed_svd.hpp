// Singular value decomposition of a 3x3 matrix with rotations on both sides.
//
// J = U diag(sigma) V^T with det U = det V = 1, so the smallest singular value carries the sign of
// det J; this keeps isotropic energies smooth through inversion. One-sided Jacobi: accurate for
// small singular values, where an eigendecomposition of J^T J is not.
#pragma once

#include <cmath>

#include "stretchmap/base/types.hpp"

namespace stretchmap::volume {

struct SignedSvd {
  Eigen::Matrix3d U, V;
  Eigen::Vector3d sigma;  // |sigma_0| >= |sigma_1| >= |sigma_2|; only sigma_2 may be negative
};

// \return J = U diag(sigma) V^T as above.
inline SignedSvd signed_svd(const Eigen::Matrix3d& J) {
  Eigen::Matrix3d B = J, V = Eigen::Matrix3d::Identity();
  for (int sweep = 0; sweep < 12; ++sweep) {
    double worst = 0.0;
    for (int p = 0; p < 2; ++p) {
      for (int q = p + 1; q < 3; ++q) {
        const double a = B.col(p).squaredNorm(), b = B.col(q).squaredNorm();
        const double c = B.col(p).dot(B.col(q));
        const double scale = a * b;
        if (c * c <= 1e-30 * scale || c == 0.0) continue;
        worst = std::max(worst, c * c / scale);
        const double zeta = (b - a) / (2.0 * c);
        const double t = (zeta >= 0 ? 1.0 : -1.0) / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
        const double cs = 1.0 / std::sqrt(1.0 + t * t), sn = cs * t;
        const Eigen::Vector3d bp = B.col(p), vp = V.col(p);
        B.col(p) = cs * bp - sn * B.col(q);
        B.col(q) = sn * bp + cs * B.col(q);
        V.col(p) = cs * vp - sn * V.col(q);
        V.col(q) = sn * vp + cs * V.col(q);
      }
    }
    if (worst < 1e-28) break;
  }
  // Order by length; every swap also negates a column so that V stays a rotation.
  const auto swap = [&](int p, int q) {
    const Eigen::Vector3d b = B.col(p), v = V.col(p);
    B.col(p) = B.col(q);
    V.col(p) = V.col(q);
    B.col(q) = -b;
    V.col(q) = -v;
  };
  if (B.col(0).squaredNorm() < B.col(1).squaredNorm()) swap(0, 1);
  if (B.col(0).squaredNorm() < B.col(2).squaredNorm()) swap(0, 2);
  if (B.col(1).squaredNorm() < B.col(2).squaredNorm()) swap(1, 2);

  SignedSvd r;
  r.V = V;
  r.sigma[0] = B.col(0).norm();
  r.U.col(0) = r.sigma[0] > 0 ? Eigen::Vector3d(B.col(0) / r.sigma[0]) : Eigen::Vector3d::UnitX();
  Eigen::Vector3d second = B.col(1) - r.U.col(0) * r.U.col(0).dot(B.col(1));
  const double length = second.norm();
  if (length > 1e-14 * r.sigma[0] && length > 0) {
    r.sigma[1] = B.col(1).norm();
    r.U.col(1) = second / length;
  } else {  // rank one: any direction orthogonal to the first will do
    r.sigma[1] = 0.0;
    r.U.col(1) = r.U.col(0).unitOrthogonal();
  }
  r.U.col(2) = r.U.col(0).cross(r.U.col(1));
  r.sigma[2] = r.U.col(2).dot(B.col(2));
  return r;
}

}  // namespace stretchmap::volume
