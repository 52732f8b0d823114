#include "stretchmap/stretch/boundary_barrier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace stretchmap {
namespace {

constexpr double kPi = 3.14159265358979323846;

double wrapped(double angle) { return std::remainder(angle, 2.0 * kPi); }

}  // namespace

BoundaryBarrier::BoundaryBarrier(Faces faces, Rows rest, Vec weights, double R, double r)
    : faces_(std::move(faces)),
      rest_(std::move(rest)),
      weights_(std::move(weights)),
      R_(R),
      r_(r) {}

Eigen::Matrix2d BoundaryBarrier::jacobian(const PointsRef& x, Index f) const {
  std::array<double, 3> u, s;
  for (int a = 0; a < 3; ++a) {
    const auto p = x.row(faces_(f, a));
    u[a] = std::atan2(p[1], p[0]);
    s[a] = std::atan2(p[2], std::hypot(p[0], p[1]) - R_) + p[2] / R_;  // r sin v = z
  }
  Eigen::Matrix2d edges;
  for (int a = 1; a < 3; ++a)
    edges.col(a - 1) << R_ * wrapped(u[a] - u[0]), r_ * wrapped(s[a] - s[0]);
  Eigen::Matrix2d rest;
  rest << rest_(f, 0), rest_(f, 1), rest_(f, 2), rest_(f, 3);
  return edges * rest;
}

double BoundaryBarrier::value(const PointsRef& x, Index f) const {
  return weights_[f] * face_energy(jacobian(x, f));
}

void BoundaryBarrier::linearise(const PointsRef& x, Index f, Eigen::Matrix<double, 6, 1>& gradient,
                                Eigen::Matrix<double, 6, 6>& hessian) const {
  Eigen::Matrix2d P;
  Matrix4 H;
  face_energy(jacobian(x, f), P, H);
  P *= weights_[f];
  H *= weights_[f];
  Eigen::Matrix<double, 3, 2> G;  // derivative of K's columns by the chart vertices
  G << 0.0, 0.0, rest_(f, 0), rest_(f, 1), rest_(f, 2), rest_(f, 3);
  G.row(0) = -(G.row(1) + G.row(2));

  // Chart position by arc length: dU = (R / rho) dp, dS = (rho / R) dq, d2S = -(sin v / R) dq^2.
  Eigen::Matrix<double, 6, 1> scale, bend;
  for (int a = 0; a < 3; ++a) {
    const auto p = x.row(faces_(f, a));
    const double rho = std::hypot(p[0], p[1]);
    scale.segment<2>(2 * a) << R_ / rho, rho / R_;
    bend.segment<2>(2 * a) << 0.0, -p[2] / (r_ * R_);
  }
  for (int a = 0; a < 3; ++a) {
    const Eigen::Vector2d g = P * G.row(a).transpose();
    for (int i = 0; i < 2; ++i) {
      const int row = 2 * a + i;
      gradient[row] += scale[row] * g[i];
      hessian(row, row) += std::max(0.0, bend[row] * g[i]);
    }
    for (int b = 0; b < 3; ++b) {
      Eigen::Matrix2d block = Eigen::Matrix2d::Zero();
      for (int k = 0; k < 2; ++k)
        for (int l = 0; l < 2; ++l) block += G(a, k) * G(b, l) * H.block<2, 2>(2 * k, 2 * l);
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j)
          hessian(2 * a + i, 2 * b + j) += scale[2 * a + i] * block(i, j) * scale[2 * b + j];
    }
  }
}

Rows rest_triangles(const PointsRef& V, const FacesRef& faces, double scale) {
  const Index m = static_cast<Index>(faces.rows());
  const double length = std::sqrt(scale);
  Rows rest(m, 4);
  for (Index f = 0; f < m; ++f) {
    const Eigen::RowVector3d a = V.row(faces(f, 1)) - V.row(faces(f, 0));
    const Eigen::RowVector3d b = V.row(faces(f, 2)) - V.row(faces(f, 0));
    const double base = a.norm();
    Eigen::Matrix2d edges;
    edges << base, a.dot(b) / base, 0.0, a.cross(b).norm() / base;
    const Eigen::Matrix2d inverse = (length * edges).inverse();
    rest.row(f) << inverse(0, 0), inverse(0, 1), inverse(1, 0), inverse(1, 1);
  }
  return rest;
}

}  // namespace stretchmap
