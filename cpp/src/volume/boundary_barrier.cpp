#include "stretchmap/volume/boundary_barrier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace stretchmap::volume {

using Eigen::Vector3d;

struct BoundaryBarrier::State {
  std::array<Vector3d, 3> x;
  std::array<Vector3d, 4> point, normal;  // corners and centroid
  Eigen::Matrix<double, 3, 2> G;          // J = sum_i x_i G.row(i)
  Eigen::Matrix<double, 3, 2> J;
  Vector3d area;        // area vector over the rest area
  double inverse_area;  // 1 / rest area
  Eigen::Vector4d sigma;
};

BoundaryBarrier::State BoundaryBarrier::state(const PointsRef& x, Index f) const {
  State s;
  for (int k = 0; k < 3; ++k) s.point[k] = s.x[k] = x.row(boundary_.faces(f, k)).transpose();
  s.point[3] = (s.x[0] + s.x[1] + s.x[2]) / 3.0;
  const auto rest = boundary_.rest.row(f);
  s.G << 0.0, 0.0, rest[0], rest[1], rest[2], rest[3];
  s.G.row(0) = -(s.G.row(1) + s.G.row(2));
  s.J.setZero();
  for (int k = 0; k < 3; ++k) s.J += s.x[k] * s.G.row(k);
  s.inverse_area = 2.0 * (rest[0] * rest[3] - rest[1] * rest[2]);
  s.area = 0.5 * s.inverse_area * (s.x[1] - s.x[0]).cross(s.x[2] - s.x[0]);
  for (int k = 0; k < 4; ++k) {
    s.normal[k] = surface().outward(s.point[k]);
    s.sigma[k] = s.area.dot(s.normal[k]);
  }
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
    report.energy += 0.5 * (I + sigma * sigma + 1.0) / regularized(sigma, epsilon).value - 2.0;
  report.energy *= 0.25 * boundary_.weights[f];
  return report;
}

void BoundaryBarrier::model(const PointsRef& x, Index f, double epsilon,
                            Eigen::Matrix<double, 6, 1>& gradient,
                            Eigen::Matrix<double, 6, 6>& hessian) const {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  const State s = state(x, f);
  std::array<Eigen::Matrix<double, 3, 2>, 3> axes;
  Matrix6 jacobian;  // of vec(J) by the six unknowns
  for (int k = 0; k < 3; ++k) {
    axes[k] = surface().frame(s.x[k]).leftCols<2>();
    for (int c = 0; c < 2; ++c) jacobian.block<3, 2>(3 * c, 2 * k) = s.G(k, c) * axes[k];
  }
  const Eigen::Map<const Vector6> J(s.J.data());
  const Vector6 slope = jacobian.transpose() * J;  // half the gradient of |J|^2
  const Matrix6 square = jacobian.transpose() * jacobian;
  const double I = s.J.squaredNorm(), weight = 0.25 * boundary_.weights[f];

  for (int k = 0; k < 4; ++k) {
    Vector6 d;  // gradient of sigma_k
    // The outward direction turns with the corner it belongs to, or with the centroid.
    const Vector3d turn = surface().outward_derivative(s.point[k]).transpose() * s.area;
    for (int i = 0; i < 3; ++i) {
      Vector3d by_x =
          0.5 * s.inverse_area * (s.x[(i + 1) % 3] - s.x[(i + 2) % 3]).cross(s.normal[k]);
      if (k == i) by_x += turn;
      if (k == 3) by_x += turn / 3.0;
      d.segment<2>(2 * i) = axes[i].transpose() * by_x;
    }

    const double sigma = s.sigma[k], N = I + sigma * sigma + 1.0;
    const Regularized chi = regularized(sigma, epsilon);
    const double q = 1.0 / chi.value, t = chi.first * q;
    gradient += weight * q * (slope + (sigma - 0.5 * N * t) * d);
    // (J, sigma, chi) -> (|J|^2 + sigma^2 + 1) / (2 chi) is convex.
    const Vector6 along = sigma * d;
    hessian += weight * q *
               (square + d * d.transpose() - t * (slope + along) * d.transpose() -
                t * d * (slope + along).transpose() + t * t * N * d * d.transpose());
  }
}

Rows rest_triangles(const PointsRef& V, const FacesRef& faces, double scale, double max_aspect) {
  const Index m = static_cast<Index>(faces.rows());
  const double length = std::sqrt(scale);
  Eigen::Matrix2d regular;
  regular << 1.0, 0.5, 0.0, std::sqrt(3.0) / 2.0;
  const Eigen::Matrix2d regular_inverse = regular.inverse();
  Rows rest(m, 4);
  for (Index f = 0; f < m; ++f) {
    Eigen::Matrix2d edges = mesh::plane_edges(V, faces, f);
    const Eigen::JacobiSVD<Eigen::Matrix2d> svd(edges * regular_inverse,
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Vector2d sigma = svd.singularValues();
    const double floor = sigma[0] / max_aspect;
    if (sigma[1] < floor) {
      const double stretch = std::sqrt(sigma[1] / floor);
      edges = svd.matrixU() * Eigen::Vector2d(stretch * sigma[0], stretch * floor).asDiagonal() *
              svd.matrixV().transpose() * regular;
    }
    const Eigen::Matrix2d inverse = (length * edges).inverse();
    rest.row(f) << inverse(0, 0), inverse(0, 1), inverse(1, 0), inverse(1, 1);
  }
  return rest;
}

}  // namespace stretchmap::volume
