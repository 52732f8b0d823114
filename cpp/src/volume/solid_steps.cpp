// How far a step of SolidEnergy goes, and where it leads.
#include <algorithm>
#include <cmath>

#include "stretchmap/volume/solid_energy.hpp"

namespace stretchmap::volume {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// What is taken of the way to where a tet turns over, and so how far ahead that has to be looked
// for.
constexpr double kShare = 0.9, kWholeStep = 1.0 / kShare;
constexpr int kHoldingPasses = 6;
constexpr double kEasing = 0.25;  // what is left of a step at the vertices of an element it harms

// Smallest root in (0, limit] of d0 + d1 a + d2 a^2 + d3 a^3 with d0 > 0; limit if there is none.
double first_root(double d0, double d1, double d2, double d3, double limit) {
  const auto p = [&](double a) { return d0 + a * (d1 + a * (d2 + a * d3)); };
  // Bernstein coefficients on [0, limit]: all positive means no root.
  const double b1 = d0 + d1 * limit / 3.0;
  const double b2 = d0 + 2.0 * d1 * limit / 3.0 + d2 * limit * limit / 3.0;
  if (b1 > 0 && b2 > 0 && p(limit) > 0) return limit;
  // March with a Lipschitz bound of the derivative: never steps over a root.
  const double bound = std::abs(d1) + limit * (2.0 * std::abs(d2) + 3.0 * limit * std::abs(d3));
  double a = 0.0;
  for (int k = 0; k < 64; ++k) {
    const double value = p(a);
    if (value <= 1e-3 * d0) return a;
    a += value / bound;
    if (a >= limit) return limit;
  }
  return a;
}

}  // namespace

Points SolidEnergy::move(const PointsRef& x, const PointsRef& step, double alpha) const {
  Points moved = x;
  const Index n_rows = rows();
#pragma omp parallel for schedule(static)
  for (Index row = 0; row < n_rows; ++row) {
    const Index i = row_vertex_[row];
    if (motion_[i] != kGliding) {
      moved.row(i) += alpha * step.row(row);
      continue;
    }
    const GlideSurface& surface = barrier_.surface();
    const Vector3d from = x.row(i).transpose();
    const Eigen::Vector2d along = alpha * step.row(row).head<2>().transpose();
    moved.row(i) = surface.moved(from, surface.place(from), along).transpose();
  }
  return moved;
}

Points SolidEnergy::in_space(const PointsRef& x, const PointsRef& step) const {
  Points direction = Points::Zero(x.rows(), 3);
  const Index n_rows = rows();
  const GlideSites at = sites(x, true);
#pragma omp parallel for schedule(static)
  for (Index row = 0; row < n_rows; ++row)
    direction.row(row_vertex_[row]) =
        (frame(at, row_vertex_[row]) * step.row(row).transpose()).transpose();
  return direction;
}

Vec SolidEnergy::longest_steps(const PointsRef& x, const PointsRef& direction) const {
  const Index k = static_cast<Index>(tets_.rows());
  Vec longest = Vec::Constant(k, kWholeStep);
#pragma omp parallel for schedule(static)
  for (Index t = 0; t < k; ++t) {
    Matrix3d E, D;
    for (int a = 1; a < 4; ++a) {
      E.col(a - 1) = x.row(tets_(t, a)) - x.row(tets_(t, 0));
      D.col(a - 1) = direction.row(tets_(t, a)) - direction.row(tets_(t, 0));
    }
    const double d0 = E.determinant();
    if (!(d0 > 0.0)) continue;
    const auto det = [](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
      return a.dot(b.cross(c));
    };
    const double d1 = det(D.col(0), E.col(1), E.col(2)) + det(E.col(0), D.col(1), E.col(2)) +
                      det(E.col(0), E.col(1), D.col(2));
    const double d2 = det(D.col(0), D.col(1), E.col(2)) + det(D.col(0), E.col(1), D.col(2)) +
                      det(E.col(0), D.col(1), D.col(2));
    longest[t] = first_root(d0, d1, d2, D.determinant(), kWholeStep);
  }
  return longest;
}

double SolidEnergy::longest_step(const PointsRef& x, const PointsRef& step) const {
  return std::min(1.0, kShare * longest_steps(x, in_space(x, step)).minCoeff());
}

Points SolidEnergy::held_back(const PointsRef& x, const PointsRef& step) const {
  Points direction = in_space(x, step), shortened = step;
  for (int pass = 0; pass < kHoldingPasses; ++pass) {
    const Vec longest = longest_steps(x, direction);
    Vec share = Vec::Ones(x.rows());
    bool held = false;
    for (Index t = 0; t < longest.size(); ++t) {
      if (longest[t] >= kWholeStep) continue;
      held = true;
      for (int a = 0; a < 4; ++a)
        share[tets_(t, a)] = std::min(share[tets_(t, a)], kShare * kShare * longest[t]);
    }
    if (!held) break;
    direction.array().colwise() *= share.array();
    for (Index row = 0; row < rows(); ++row) shortened.row(row) *= share[row_vertex_[row]];
  }
  return shortened;
}

Points SolidEnergy::eased(const PointsRef& x, const PointsRef& step, const EnergyWeights& w,
                          double most) const {
  const Energies before = energies(x, w), after = energies(move(x, step, 1.0), w);
  Vec share = Vec::Ones(x.rows());
  const auto hold = [&](const auto& corners, double rise) {
    if (rise <= most) return;
    for (const Index i : corners) share[i] = kEasing;
  };
  for (Index t = 0; t < before.tets.size(); ++t) hold(tets_.row(t), after.tets[t] - before.tets[t]);
  for (Index f = 0; f < before.faces.size(); ++f)
    hold(barrier_.faces().row(f), after.faces[f] - before.faces[f]);
  Points shortened = step;
  for (Index row = 0; row < rows(); ++row) shortened.row(row) *= share[row_vertex_[row]];
  return shortened;
}

Rows SolidEnergy::near_nullspace(const PointsRef& x) const {
  Rows modes(3 * rows(), 3);
  const GlideSites at = sites(x, true);
  for (Index row = 0; row < rows(); ++row)
    modes.middleRows<3>(3 * row) = frame(at, row_vertex_[row]).transpose();
  return modes;
}

}  // namespace stretchmap::volume
