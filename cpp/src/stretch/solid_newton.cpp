#include "stretchmap/stretch/solid_newton.hpp"

#include <cmath>

#include "stretchmap/base/errors.hpp"

namespace stretchmap {

// The projected Hessian is stiffer than the true one, so the energy often falls at the end of the
// full step as steeply as at its start. Then twice the step is tried.
void SolidNewton::try_double_step(Points& x, const Points& start, const Points& direction,
                                  const EnergyWeights& w, NewtonReport& report) const {
  const double decrease = report.before.energy - report.after.energy;
  if (decrease < 0.6 * report.alpha * report.decrement) return;
  Points trial = energy_.move(start, direction, 2.0 * report.alpha);
  const EnergyReport there = energy_.value(trial, w);
  if (!(there.energy < report.after.energy)) return;
  x = std::move(trial);
  report.after = there;
  report.alpha *= 2.0;
}

NewtonReport SolidNewton::step(Points& x, const EnergyWeights& w, const NewtonOptions& options,
                               const Poll& poll) {
  NewtonReport report;
  report.before = report.after = energy_.value(x, w);
  if (!std::isfinite(report.before.energy))
    throw Error("SolverError", "the energy is infinite: " + std::to_string(report.before.flips) +
                                   " inverted tets and " + std::to_string(report.before.folds) +
                                   " folded boundary faces; untangle first");
  if (energy_.rows() == 0) return report;

  Points gradient;
  if (!solver_) {
    BlockMatrix hessian = energy_.pattern();
    energy_.linearise(x, w, gradient, hessian);
    solver_ = std::make_unique<BlockSolver>(std::move(hessian), energy_.near_nullspace(x));
  } else {
    energy_.linearise(x, w, gradient, solver_->matrix());
    solver_->refactor();
  }
  report.gradient_norm = gradient.norm();
  if (report.gradient_norm == 0.0) return report;

  SolveOptions solve;
  solve.tol = options.tol;
  solve.max_iter = options.max_cg;
  solve.must_converge = false;
  Points direction = Points::Zero(gradient.rows(), 3);
  const SolveReport solved = solver_->solve(-gradient, direction, solve, poll);
  report.cg_iterations = solved.iterations;
  report.negative_curvature = solved.negative_curvature;
  report.cg_residual = solved.residual.size() > 0 ? solved.residual.maxCoeff() : 0.0;
  report.decrement = -(gradient.array() * direction.array()).sum();
  if (!(report.decrement > 0.0)) return report;

  const Points start = x;
  double alpha = w.epsilon > 0.0 ? 1.0 : energy_.longest_step(x, direction);
  for (int k = 0; k <= options.max_halvings; ++k, alpha *= 0.5) {
    Points trial = energy_.move(start, direction, alpha);
    const EnergyReport there = energy_.value(trial, w);
    if (there.energy <= report.before.energy - options.armijo * alpha * report.decrement) {
      x = std::move(trial);
      report.after = there;
      report.alpha = alpha;
      if (k == 0) try_double_step(x, start, direction, w, report);
      break;
    }
  }
  return report;
}

}  // namespace stretchmap
