#include "stretchmap/stretch/element_energy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stretchmap/stretch/signed_svd.hpp"

namespace stretchmap {
namespace {

// psi as a function of I = tr(J^T J) and D = det J: psi = a(D) I + b(D).
struct Terms {
  double a, a1, a2;  // a and its derivatives in D
  double b, b1, b2;
};

Terms terms(double D, const EnergyWeights& w) {
  const double root = std::sqrt(w.epsilon * w.epsilon + D * D);
  // For negative D the sum cancels; epsilon^2 / (root - D) / 2 is the same number.
  const double chi = D >= 0 ? 0.5 * (D + root) : 0.5 * w.epsilon * w.epsilon / (root - D);
  const double chi1 = w.epsilon > 0 ? chi / root : 1.0;
  const double chi2 = w.epsilon > 0 ? 0.5 * w.epsilon * w.epsilon / (root * root * root) : 0.0;
  Terms t;
  const double c = w.shape / 3.0;
  t.a = c * std::pow(chi, -2.0 / 3.0);
  t.a1 = -2.0 / 3.0 * t.a / chi * chi1;
  t.a2 = -2.0 / 3.0 * t.a / chi * (chi2 - 5.0 / 3.0 * chi1 * chi1 / chi);
  const double m = 0.5 * w.volume, N = D * D + 1.0, q = 1.0 / chi;
  t.b = m * N * q - w.shape - w.volume;
  t.b1 = m * (2.0 * D * q - N * q * q * chi1);
  t.b2 =
      m * (2.0 * q - 4.0 * D * q * q * chi1 + 2.0 * N * q * q * q * chi1 * chi1 - N * q * q * chi2);
  return t;
}

void add_mode(Matrix9& H, double eigenvalue, const Eigen::Matrix3d& mode) {
  if (eigenvalue <= 0.0) return;
  const Eigen::Map<const Eigen::Matrix<double, 9, 1>> q(mode.data());
  H.noalias() += (eigenvalue * q) * q.transpose();
}

}  // namespace

double element_energy(const Eigen::Matrix3d& J, const EnergyWeights& w) {
  const double D = J.determinant();
  if (w.epsilon <= 0.0 && !(D > 0.0)) return std::numeric_limits<double>::infinity();
  const Terms t = terms(D, w);
  return t.a * J.squaredNorm() + t.b;
}

double element_energy(const Eigen::Matrix3d& J, const EnergyWeights& w, Eigen::Matrix3d& P,
                      Matrix9* H) {
  Eigen::Matrix3d cof;
  cof.col(0) = J.col(1).cross(J.col(2));
  cof.col(1) = J.col(2).cross(J.col(0));
  cof.col(2) = J.col(0).cross(J.col(1));
  const double D = J.col(0).dot(cof.col(0)), I = J.squaredNorm();
  const Terms t = terms(D, w);
  const double slope = t.a1 * I + t.b1;  // d psi / dD
  P = 2.0 * t.a * J + slope * cof;
  if (!H) return t.a * I + t.b;

  const SignedSvd svd = signed_svd(J);
  const Eigen::Vector3d& s = svd.sigma;
  const double curvature = t.a2 * I + t.b2;
  const Eigen::Vector3d d(s[1] * s[2], s[0] * s[2], s[0] * s[1]);  // dD / d sigma
  Eigen::Matrix3d A;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      A(i, j) = 2.0 * t.a1 * (s[i] * d[j] + s[j] * d[i]) + curvature * d[i] * d[j] +
                (i == j ? 2.0 * t.a : slope * s[3 - i - j]);

  H->setZero();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.compute(A);
  for (int k = 0; k < 3; ++k)
    add_mode(*H, eigen.eigenvalues()[k],
             svd.U * eigen.eigenvectors().col(k).asDiagonal() * svd.V.transpose());
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const Eigen::Matrix3d ij = std::sqrt(0.5) * svd.U.col(i) * svd.V.col(j).transpose();
    const Eigen::Matrix3d ji = std::sqrt(0.5) * svd.U.col(j) * svd.V.col(i).transpose();
    add_mode(*H, 2.0 * t.a + slope * s[k], ij - ji);
    add_mode(*H, 2.0 * t.a - slope * s[k], ij + ji);
  }
  return t.a * I + t.b;
}

double face_energy(const Eigen::Matrix2d& K) {
  const double D = K.determinant();
  if (!(D > 0.0)) return std::numeric_limits<double>::infinity();
  return 0.5 * (K.squaredNorm() / D + D + 1.0 / D) - 2.0;
}

double face_energy(const Eigen::Matrix2d& K, Eigen::Matrix2d& P, Matrix4& H) {
  using Eigen::Matrix2d;
  using Eigen::Vector2d;
  const double D = K.determinant(), I = K.squaredNorm();
  // phi = a(D) I + b(D) with a = 1 / (2 D), b = (D + 1 / D) / 2 - 2.
  const double a = 0.5 / D, a1 = -a / D, a2 = -2.0 * a1 / D;
  const double slope = a1 * I + 0.5 * (1.0 - 1.0 / (D * D));
  const double curvature = a2 * I + 1.0 / (D * D * D);
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
  return a * I + 0.5 * (D + 1.0 / D) - 2.0;
}

}  // namespace stretchmap
