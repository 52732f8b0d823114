#include "stretchmap/resample/hex_newton.hpp"

#include <cmath>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/linalg/backtrack.hpp"

namespace stretchmap::resample {
namespace {

constexpr int kTries = 21;

}  // namespace

// False if no lower energy was found.
bool HexNewton::step(Points& x, const HexWeights& w, const HexNewtonOptions& options,
                     const Poll& poll, HexNewtonReport& report) {
  Points gradient;
  if (!solver_) {
    linalg::BlockMatrix hessian = energy_.pattern();
    energy_.model(x, w, gradient, hessian);
    solver_ = std::make_unique<linalg::BlockSolver>(std::move(hessian),
                                                    linalg::BlockOptions{options.preconditioner});
  } else {
    energy_.model(x, w, gradient, solver_->matrix());
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
  Points trial;
  HexReport there;
  const auto energy = [&](double alpha) {
    if (poll) poll();
    trial = x + alpha * direction;
    there = energy_.value(trial, w);
    return there.energy;
  };
  if (linalg::backtrack(report.after.energy, -decrement, 1.0, kTries, energy) == 0.0) return false;
  x = std::move(trial);
  report.after = there;
  return true;
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
