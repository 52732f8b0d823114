#include "stretchmap/volume/boundary_barrier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace stretchmap::volume {

using Eigen::Vector3d;

struct BoundaryBarrier::State {
  std::array<Vector3d, 3> x, e_u, e_v;
  std::array<Vector3d, 4> normal;
  std::array<double, 3> rho, cos_v;
  Eigen::Matrix<double, 3, 2> G;  // J = sum_i x_i G.row(i)
  Eigen::Matrix<double, 3, 2> J;
  Vector3d area;        // area vector over the rest area
  double inverse_area;  // 1 / rest area
  Eigen::Vector4d sigma;
  Eigen::Matrix3d turn;  // derivative of normal[3] by the centroid
};

BoundaryBarrier::BoundaryBarrier(Faces faces, Rows rest, Vec weights, double R, double r)
    : faces_(std::move(faces)),
      rest_(std::move(rest)),
      weights_(std::move(weights)),
      R_(R),
      r_(r) {}

BoundaryBarrier::State BoundaryBarrier::state(const PointsRef& x, Index f) const {
  State s;
  for (int k = 0; k < 3; ++k) {
    s.x[k] = x.row(faces_(f, k)).transpose();
    s.rho[k] = s.x[k].head<2>().norm();
    const double cu = s.x[k][0] / s.rho[k], su = s.x[k][1] / s.rho[k];
    const double cv = (s.rho[k] - R_) / r_, sv = s.x[k][2] / r_;
    s.cos_v[k] = cv;
    s.e_u[k] << -su, cu, 0.0;
    s.e_v[k] << -sv * cu, -sv * su, cv;
    s.normal[k] << cv * cu, cv * su, sv;
  }
  s.G << 0.0, 0.0, rest_(f, 0), rest_(f, 1), rest_(f, 2), rest_(f, 3);
  s.G.row(0) = -(s.G.row(1) + s.G.row(2));
  s.J.setZero();
  for (int k = 0; k < 3; ++k) s.J += s.x[k] * s.G.row(k);
  s.inverse_area = 2.0 * (rest_(f, 0) * rest_(f, 3) - rest_(f, 1) * rest_(f, 2));
  s.area = 0.5 * s.inverse_area * (s.x[1] - s.x[0]).cross(s.x[2] - s.x[0]);
  const Vector3d centroid = (s.x[0] + s.x[1] + s.x[2]) / 3.0;
  const double rho = centroid.head<2>().norm();
  const Vector3d along(-centroid[1] / rho, centroid[0] / rho, 0.0);  // e_u at the centroid
  const Vector3d off = centroid - R_ / rho * Vector3d(centroid[0], centroid[1], 0.0);
  s.normal[3] = off.normalized();
  s.turn = (Eigen::Matrix3d::Identity() - s.normal[3] * s.normal[3].transpose()) / off.norm() *
           (Eigen::Matrix3d::Identity() - R_ / rho * along * along.transpose());
  for (int k = 0; k < 4; ++k) s.sigma[k] = s.area.dot(s.normal[k]);
  return s;
}

FaceReport BoundaryBarrier::value(const PointsRef& x, Index f, double epsilon) const {
  const State s = state(x, f);
  FaceReport report;
  report.facing = s.sigma.minCoeff();
  if (epsilon <= 0.0 && !(report.facing > 0.0)) {
    report.energy = std::numeric_limits<double>::infinity();
    return report;
  }
  const double I = s.J.squaredNorm();
  for (const double sigma : s.sigma)
    report.energy += 0.5 * (I + sigma * sigma + 1.0) / regularised(sigma, epsilon).value - 2.0;
  report.energy *= 0.25 * weights_[f];
  return report;
}

void BoundaryBarrier::linearise(const PointsRef& x, Index f, double epsilon,
                                Eigen::Matrix<double, 6, 1>& gradient,
                                Eigen::Matrix<double, 6, 6>& hessian) const {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  const State s = state(x, f);
  Matrix6 jacobian;  // of vec(J) by the six unknowns
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < 2; ++c) {
      jacobian.block<3, 1>(3 * c, 2 * k) = s.G(k, c) * s.e_u[k];
      jacobian.block<3, 1>(3 * c, 2 * k + 1) = s.G(k, c) * s.e_v[k];
    }
  }
  const Eigen::Map<const Vector6> J(s.J.data());
  const Vector6 slope = jacobian.transpose() * J;  // half the gradient of |J|^2
  const Matrix6 square = jacobian.transpose() * jacobian;
  const double I = s.J.squaredNorm(), weight = 0.25 * weights_[f];

  for (int k = 0; k < 4; ++k) {
    Vector6 d;  // gradient of sigma_k
    for (int i = 0; i < 3; ++i) {
      Vector3d by_x =
          0.5 * s.inverse_area * (s.x[(i + 1) % 3] - s.x[(i + 2) % 3]).cross(s.normal[k]);
      if (k == 3) by_x += s.turn.transpose() * s.area / 3.0;
      d[2 * i] = by_x.dot(s.e_u[i]);
      d[2 * i + 1] = by_x.dot(s.e_v[i]);
    }
    if (k < 3) {  // the torus' own normal turns with the corner
      d[2 * k] += s.cos_v[k] / s.rho[k] * s.area.dot(s.e_u[k]);
      d[2 * k + 1] += s.area.dot(s.e_v[k]) / r_;
    }

    const double sigma = s.sigma[k], N = I + sigma * sigma + 1.0;
    const Regularised chi = regularised(sigma, epsilon);
    const double q = 1.0 / chi.value, t = chi.first * q;
    gradient += weight * q * (slope + (sigma - 0.5 * N * t) * d);
    // (J, sigma, chi) -> (|J|^2 + sigma^2 + 1) / (2 chi) is convex.
    const Vector6 along = sigma * d;
    hessian += weight * q *
               (square + d * d.transpose() - t * (slope + along) * d.transpose() -
                t * d * (slope + along).transpose() + t * t * N * d * d.transpose());
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

}  // namespace stretchmap::volume
