#include "stretchmap/area/face_damping.hpp"

#include <algorithm>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::area {

namespace {

constexpr int kMostSolves = 4;                  // in a step
constexpr double kEnough = 0.6;                 // of a step before the first face turns over
constexpr double kShare = 0.9;                  // of the way there
constexpr double kFirst = 0.1, kGrowth = 30.0;  // of the damping, from solve to solve
constexpr double kFading = 0.25, kNone = 1e-3;  // from step to step, until there is none

}  // namespace

DampedDirection FaceDamping::direction(const SurfaceChart& chart, const Points2Ref& turns,
                                       const Vec& weights, Rows& hessians, const Solve& solve) {
  const Index m = static_cast<Index>(chart.faces.rows());
  const Eigen::Matrix2d scale =
      (lengths_ * lengths_.cwiseInverse().transpose()).array().square().matrix();
  // Adds weight |L dJ J^-1 L^-1|^2 / 2, L = diag(lengths).
  const auto add = [&](Index f, double weight) {
    Eigen::Matrix<double, 3, 2> G;
    G.bottomRows<2>() = (turn_ * chart.edges(turns, f)).inverse();
    G.row(0) = -(G.row(1) + G.row(2));
    Eigen::Map<Eigen::Matrix<double, 6, 6>> hessian(hessians.row(f).data());
    for (int i = 0; i < 2; ++i) {
      const Eigen::Matrix3d entries = weight * G * scale.row(i).asDiagonal() * G.transpose();
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l) hessian(2 * k + i, 2 * l + i) += entries(k, l);
    }
  };
  const auto damped = [&](const auto& by) {
    for_rows(m, kElementChunk, [&](Index f) {
      const double weight = by(f);
      if (weight > 0.0) add(f, weights(f) * weight);
    });
  };
  if (damping_.size()) damped([&](Index f) { return damping_(f); });
  DampedDirection found;
  for (int solves = 1;; ++solves) {
    found.direction = solve(hessians);
    const Vec steps = unfolded_steps(chart, turns, found.direction / turn_);
    const double least = m ? steps.minCoeff() : 1.0;
    found.longest = std::min(kShare * least, 1.0);
    if (least >= kEnough || solves == kMostSolves) break;
    if (!damping_.size()) damping_ = Vec::Zero(m);
    damped([&](Index f) {
      if (steps(f) >= 1.0) return 0.0;
      const double before = damping_(f);
      damping_(f) = std::max(kGrowth * before, kFirst);
      return damping_(f) - before;
    });
  }
  if (damping_.size()) {
    damping_ = (kFading * damping_.array() < kNone).select(0.0, kFading * damping_.array());
    if ((damping_.array() == 0.0).all()) damping_.resize(0);
  }
  return found;
}

}  // namespace stretchmap::area
