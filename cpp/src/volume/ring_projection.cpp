#include "stretchmap/volume/ring_projection.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/mesh/size.hpp"

namespace stretchmap::volume {
namespace {

using Row3 = Eigen::RowVector3d;

// Derivatives of every tet's volume by its corners: slopes[c].row(t).
std::vector<Points> volume_slopes(const PointsRef& x, const TetsRef& tets) {
  const Index k = static_cast<Index>(tets.rows());
  std::vector<Points> slopes(4, Points(k, 3));
  for_rows(k, [&](Index t) {
    const Row3 a = x.row(tets(t, 0));
    const Row3 b = x.row(tets(t, 1)) - a, c = x.row(tets(t, 2)) - a, d = x.row(tets(t, 3)) - a;
    slopes[1].row(t) = c.cross(d) / 6.0;
    slopes[2].row(t) = d.cross(b) / 6.0;
    slopes[3].row(t) = b.cross(c) / 6.0;
    slopes[0].row(t) = -(slopes[1].row(t) + slopes[2].row(t) + slopes[3].row(t));
  });
  return slopes;
}

}  // namespace

RingProjection::RingProjection(const TetsRef& tets, const FlagsRef& fixed)
    : tets_(tets), fixed_(fixed), corners_(corners_at(tets, static_cast<Index>(fixed.size()))) {}

Vec RingProjection::rings(const VecRef& tet_values) const {
  const Index n = static_cast<Index>(fixed_.size());
  Vec sums = Vec::Zero(n);
  for_rows(n, [&](Index i) {
    if (fixed_[i]) return;
    for (const Index corner : corners_[i]) sums[i] += tet_values[corner / 4];
  });
  return sums;
}

Points RingProjection::transposed(const std::vector<Points>& slopes, const Vec& z) const {
  const Index n = static_cast<Index>(fixed_.size()), k = static_cast<Index>(tets_.rows());
  Vec tet(k);
  for_rows(k, [&](Index t) {
    tet[t] = z[tets_(t, 0)] + z[tets_(t, 1)] + z[tets_(t, 2)] + z[tets_(t, 3)];
  });
  Points d = Points::Zero(n, 3);
  for_rows(n, [&](Index i) {
    if (fixed_[i]) return;
    for (const Index corner : corners_[i])
      d.row(i) += tet[corner / 4] * slopes[corner % 4].row(corner / 4);
  });
  return d;
}

Vec RingProjection::forward(const std::vector<Points>& slopes, const Points& d) const {
  const Index k = static_cast<Index>(tets_.rows());
  Vec tet(k);
  for_rows(k, [&](Index t) {
    double sum = 0.0;
    for (int c = 0; c < 4; ++c) sum += slopes[c].row(t).dot(d.row(tets_(t, c)));
    tet[t] = sum;
  });
  return rings(tet);
}

double RingProjection::error(const PointsRef& x, const VecRef& target) const {
  const Vec current = rings(mesh::tet_volumes(x, tets_));
  double worst = 0.0;
  for (Index i = 0; i < fixed_.size(); ++i) {
    if (fixed_[i]) continue;
    const double off = std::abs(current[i] / target[i] - 1.0);
    if (std::isnan(off)) return off;
    worst = std::max(worst, off);
  }
  return worst;
}

RingStep RingProjection::step(const PointsRef& x, const VecRef& target, double tol, int max_cg,
                              const Poll& poll) const {
  RingStep result;
  result.error = error(x, target);
  result.x = x;
  const std::vector<Points> slopes = volume_slopes(x, tets_);
  Vec residual = rings(mesh::tet_volumes(x, tets_));
  for (Index i = 0; i < fixed_.size(); ++i) residual[i] = fixed_[i] ? 0.0 : target[i] - residual[i];

  const double goal = tol * residual.norm();
  Vec z = Vec::Zero(residual.size()), p = residual;
  double square = residual.squaredNorm();
  while (!(std::sqrt(square) <= goal)) {
    if (result.cg_iterations++ == max_cg)
      throw Error("SolverError", "the ring volumes could not be made exact: residual " +
                                     std::to_string(std::sqrt(square) / goal) +
                                     " times its goal after " + std::to_string(max_cg) +
                                     " iterations");
    if (poll && result.cg_iterations % 16 == 0) poll();
    const Vec Ap = forward(slopes, transposed(slopes, p));
    const double curvature = p.dot(Ap);
    if (!(curvature > 0.0))
      throw Error(
          "SolverError",
          "the ring volumes could not be made exact: some do not depend on any free vertex");
    const double alpha = square / curvature;
    z += alpha * p;
    residual -= alpha * Ap;
    const double next = residual.squaredNorm();
    p = residual + (next / square) * p;
    square = next;
  }
  result.x += transposed(slopes, z);
  return result;
}

}  // namespace stretchmap::volume
