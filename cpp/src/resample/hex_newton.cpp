#include "stretchmap/resample/hex_newton.hpp"

#include <cmath>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::resample {
namespace {

constexpr int kMostHalvings = 20;
constexpr double kArmijo = 1e-4;  // demanded share of the predicted decrease

}  // namespace

// False if no lower energy was found.
bool HexNewton::step(Points& x, const HexWeights& w, const HexNewtonOptions& options,
                     const Poll& poll, HexNewtonReport& report) {
  Points gradient;
  if (!solver_) {
    linalg::BlockMatrix hessian = energy_.pattern();
    energy_.linearize(x, w, gradient, hessian);
    solver_ = std::make_unique<linalg::BlockSolver>(std::move(hessian));
  } else {
    energy_.linearize(x, w, gradient, solver_->matrix());
    solver_->refactor();
  }
  linalg::SolveOptions solve;
  solve.tol = options.tol;
  solve.max_iter = options.max_cg;
  solve.must_converge = false;
  Points direction = Points::Zero(gradient.rows(), 3);
  report.cg_iterations += solver_->solve(-gradient, direction, solve, poll).iterations;
  const double decrement = -(gradient.array() * direction.array()).sum();
  if (!(decrement > 0.0)) return false;
  double alpha = 1.0;
  for (int k = 0; k <= kMostHalvings; ++k, alpha *= 0.5) {
    Points trial = x + alpha * direction;
    const HexReport there = energy_.value(trial, w);
    if (!(there.energy <= report.after.energy - kArmijo * alpha * decrement)) continue;
    x = std::move(trial);
    report.after = there;
    return true;
  }
  return false;
}

HexNewtonReport HexNewton::run(Points& x, const HexWeights& w, const HexNewtonOptions& options,
                               const Poll& poll) {
  HexNewtonReport report;
  report.before = report.after = energy_.value(x, w);
  if (!std::isfinite(report.before.energy))
    throw Error("SolverError",
                "the energy of the grid is infinite: " + std::to_string(report.before.flips) +
                    " corners are not positive; untangle first");
  while (report.steps < options.max_steps) {
    if (poll) poll();
    const double before = report.after.energy;
    if (!step(x, w, options, poll, report)) break;
    ++report.steps;
    if (before - report.after.energy < options.least_gain * before) break;
  }
  return report;
}

}  // namespace stretchmap::resample
