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
  const auto [chi, chi1, chi2] = regularised(D, w.epsilon);
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

}  // namespace stretchmap
