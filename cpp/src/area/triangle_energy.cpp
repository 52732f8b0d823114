#include "stretchmap/area/triangle_energy.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace stretchmap::area {

double triangle_value(const Eigen::Matrix2d& K, const TriangleWeights& weights) {
  const double D = K.determinant();
  if (!(D > 0.0)) return std::numeric_limits<double>::infinity();
  return weights.shape * (0.5 * K.squaredNorm() / D - 1.0) +
         weights.area * ((D - 1.0) * (D - 1.0) / D);
}

void triangle_model(const Eigen::Matrix2d& K, Eigen::Matrix2d& P, Matrix4& H,
                    const TriangleWeights& weights) {
  using Eigen::Matrix2d;
  using Eigen::Vector2d;
  const double D = K.determinant(), I = K.squaredNorm();
  // phi = a(D) I + b(D) with a = shape / (2 D), b = area (D + 1 / D) up to a constant.
  const double a = 0.5 * weights.shape / D, a1 = -a / D, a2 = -2.0 * a1 / D;
  const double slope = a1 * I + weights.area * (1.0 - 1.0 / (D * D));
  const double curvature = a2 * I + 2.0 * weights.area / (D * D * D);
  Matrix2d cof;
  cof << K(1, 1), -K(1, 0), -K(0, 1), K(0, 0);
  P = 2.0 * a * K + slope * cof;

  // K = U diag(s) V^T with rotations, from the angles of its conformal and anticonformal parts.
  const double e = 0.5 * (K(0, 0) + K(1, 1)), f = 0.5 * (K(0, 0) - K(1, 1));
  const double g = 0.5 * (K(1, 0) + K(0, 1)), h = 0.5 * (K(1, 0) - K(0, 1));
  const double q = std::hypot(e, h), r = std::hypot(f, g);
  const double sum = std::atan2(h, e), difference = std::atan2(g, f);
  const Matrix2d U = Eigen::Rotation2Dd(0.5 * (sum + difference)).toRotationMatrix();
  const Matrix2d V = Eigen::Rotation2Dd(0.5 * (difference - sum)).toRotationMatrix();
  const Vector2d s(q + r, q - r), d(s[1], s[0]);
  Matrix2d A;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      A(i, j) = 2.0 * a1 * (s[i] * d[j] + s[j] * d[i]) + curvature * d[i] * d[j] +
                (i == j ? 2.0 * a : slope);
  H.setZero();
  const auto add = [&](double eigenvalue, const Matrix2d& core) {
    if (eigenvalue <= 0.0) return;
    const Matrix2d mode = U * core * V.transpose();
    const Eigen::Map<const Eigen::Vector4d> m(mode.data());
    H.noalias() += (eigenvalue * m) * m.transpose();
  };
  Eigen::SelfAdjointEigenSolver<Matrix2d> eigen;
  eigen.computeDirect(A);
  for (int k = 0; k < 2; ++k)
    add(eigen.eigenvalues()[k], Matrix2d(eigen.eigenvectors().col(k).asDiagonal()));
  Matrix2d twist, flip;
  twist << 0.0, 1.0, -1.0, 0.0;
  flip << 0.0, 1.0, 1.0, 0.0;
  add(2.0 * a + slope, std::sqrt(0.5) * twist);
  add(2.0 * a - slope, std::sqrt(0.5) * flip);
}

}  // namespace stretchmap::area
