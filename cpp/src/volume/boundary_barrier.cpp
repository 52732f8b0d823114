#include "stretchmap/volume/boundary_barrier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/mesh/rounded_triangle.hpp"

namespace stretchmap::volume {

using Eigen::Vector3d;

struct BoundaryBarrier::State {
  std::array<Vector3d, 3> x;
  Vector3d centroid;
  int samples;                     // of the outward direction: at corners and centroid, or one
  std::array<Vector3d, 4> normal;  // for all
  double length;                   // of the sum of the corners' directions
  Eigen::Matrix<double, 3, 2> G;   // J = sum_i x_i G.row(i)
  Eigen::Matrix<double, 3, 2> J;
  Vector3d area;        // area vector over the rest area
  double inverse_area;  // 1 / rest area
  std::array<double, 4> sigma;
};

BoundaryBarrier::State BoundaryBarrier::state(const PointsRef& x, const GlideSites& sites,
                                              Index f) const {
  State s;
  for (int k = 0; k < 3; ++k) s.x[k] = x.row(boundary_.faces(f, k)).transpose();
  s.centroid = (s.x[0] + s.x[1] + s.x[2]) / 3.0;
  const auto rest = boundary_.rest.row(f);
  s.G << 0.0, 0.0, rest[0], rest[1], rest[2], rest[3];
  s.G.row(0) = -(s.G.row(1) + s.G.row(2));
  s.J.setZero();
  for (int k = 0; k < 3; ++k) s.J += s.x[k] * s.G.row(k);
  s.inverse_area = 2.0 * (rest[0] * rest[3] - rest[1] * rest[2]);
  s.area = 0.5 * s.inverse_area * (s.x[1] - s.x[0]).cross(s.x[2] - s.x[0]);
  s.samples = surface().smooth() ? 4 : 1;
  for (int k = 0; k < 3; ++k) s.normal[k] = sites(boundary_.faces(f, k)).outward;
  if (s.samples == 4) {
    // From the first corner: the centroid's closest point may lie on another sheet.
    s.normal[3] = surface().outward(s.centroid, sites(boundary_.faces(f, 0)).place);
  } else {
    s.normal[0] += s.normal[1] + s.normal[2];
    s.length = s.normal[0].norm();
    // Of directions that cancel nothing can be said: then the face counts as folded.
    s.normal[0] /= std::max(s.length, 1e-300);
  }
  for (int k = 0; k < s.samples; ++k) s.sigma[k] = s.area.dot(s.normal[k]);
  return s;
}

// Gradients by the corners of sigma_k, the area vector held: how the direction turns.
std::array<Vector3d, 3> BoundaryBarrier::turned(const State& s, const GlideSites& sites, Index f,
                                                int k) const {
  std::array<Vector3d, 3> by_corner;
  by_corner.fill(Vector3d::Zero());
  const auto turn = [&](int i) { return sites(boundary_.faces(f, i)).turn.transpose(); };
  if (s.samples == 1) {
    for (int i = 0; i < 3; ++i)
      by_corner[i] = turn(i) * (s.area - s.sigma[0] * s.normal[0]) / std::max(s.length, 1e-300);
  } else if (k < 3) {
    by_corner[k] = turn(k) * s.area;
  } else {
    const Index place = sites(boundary_.faces(f, 0)).place;
    by_corner.fill(surface().outward_derivative(s.centroid, place).transpose() * s.area / 3.0);
  }
  return by_corner;
}

FaceReport BoundaryBarrier::value(const PointsRef& x, const GlideSites& sites, Index f,
                                  double epsilon) const {
  const State s = state(x, sites, f);
  FaceReport report;
  report.facing = *std::min_element(s.sigma.begin(), s.sigma.begin() + s.samples);
  if (epsilon <= 0.0 && !(report.facing > 0.0)) {
    report.energy = std::numeric_limits<double>::infinity();
    return report;
  }
  const double I = s.J.squaredNorm();
  for (int k = 0; k < s.samples; ++k)
    report.energy +=
        0.5 * (I + s.sigma[k] * s.sigma[k] + 1.0) / regularized(s.sigma[k], epsilon).value - 2.0;
  report.energy *= boundary_.weights[f] / s.samples;
  return report;
}

void BoundaryBarrier::model(const PointsRef& x, const GlideSites& sites, Index f, double epsilon,
                            Eigen::Matrix<double, 6, 1>& gradient,
                            Eigen::Matrix<double, 6, 6>* hessian) const {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  const State s = state(x, sites, f);
  std::array<Eigen::Matrix<double, 3, 2>, 3> axes;
  Matrix6 jacobian;  // of vec(J) by the six unknowns
  for (int k = 0; k < 3; ++k) {
    axes[k] = sites(boundary_.faces(f, k)).frame.leftCols<2>();
    for (int c = 0; c < 2; ++c) jacobian.block<3, 2>(3 * c, 2 * k) = s.G(k, c) * axes[k];
  }
  const Eigen::Map<const Vector6> J(s.J.data());
  const Vector6 slope = jacobian.transpose() * J;  // half the gradient of |J|^2
  const double I = s.J.squaredNorm(), weight = boundary_.weights[f] / s.samples;
  double stiffness = 0.0;  // of |J|^2 / 2

  for (int k = 0; k < s.samples; ++k) {
    Vector6 d;  // gradient of sigma_k
    const std::array<Vector3d, 3> turning = turned(s, sites, f, k);
    for (int i = 0; i < 3; ++i) {
      const Vector3d by_area =
          0.5 * s.inverse_area * (s.x[(i + 1) % 3] - s.x[(i + 2) % 3]).cross(s.normal[k]);
      d.segment<2>(2 * i) = axes[i].transpose() * (by_area + turning[i]);
    }

    const double sigma = s.sigma[k], N = I + sigma * sigma + 1.0;
    const Regularized chi = regularized(sigma, epsilon);
    const double q = 1.0 / chi.value, t = chi.first * q;
    gradient += weight * q * (slope + (sigma - 0.5 * N * t) * d);
    if (!hessian) continue;
    // (J, sigma, chi) -> (|J|^2 + sigma^2 + 1) / (2 chi) is convex; what is added besides |J|^2 is
    // d c' + c d'.
    stiffness += weight * q;
    const Vector6 c = weight * q * ((0.5 + t * (0.5 * t * N - sigma)) * d - t * slope);
    for (int j = 0; j < 6; ++j) hessian->col(j) += c[j] * d + d[j] * c;
  }
  if (hessian) hessian->noalias() += stiffness * (jacobian.transpose() * jacobian);
}

Vec least_facing(const GlidingBoundary& boundary, const PointsRef& x) {
  IndexVec number = IndexVec::Constant(x.rows(), -1);
  std::vector<Index> vertices;
  for (int k = 0; k < 3; ++k) {
    for (const Index i : boundary.faces.col(k)) {
      if (number[i] >= 0) continue;
      number[i] = static_cast<Index>(vertices.size());
      vertices.push_back(i);
    }
  }
  const GlideSites sites = sites_at(*boundary.surface, x, vertices, number, false);
  const BoundaryBarrier barrier(boundary);
  Vec facing(barrier.size());
  for_rows(barrier.size(), kElementChunk,
           [&](Index f) { facing[f] = barrier.value(x, sites, f, 1.0).facing; });
  return facing;
}

Rows rest_triangles(const PointsRef& V, const FacesRef& faces, double scale, double max_aspect) {
  const Index m = static_cast<Index>(faces.rows());
  const double length = std::sqrt(scale);
  Rows rest(m, 4);
  for (Index f = 0; f < m; ++f) {
    const Eigen::Matrix2d edges =
        mesh::rounded_triangle(mesh::plane_edges(V, faces, f), max_aspect);
    const Eigen::Matrix2d inverse = (length * edges).inverse();
    rest.row(f) << inverse(0, 0), inverse(0, 1), inverse(1, 0), inverse(1, 1);
  }
  return rest;
}

}  // namespace stretchmap::volume
