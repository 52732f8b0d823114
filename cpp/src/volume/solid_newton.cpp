#include "stretchmap/volume/solid_newton.hpp"

#include <cmath>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::volume {

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

// Gradient at x, and the Hessian or what the last step tells about its change.
void SolidNewton::renew(const PointsRef& x, const EnergyWeights& w, bool keep) {
  keep = keep && solver_ && last_step_.size() > 0;
  if (!solver_) {
    linalg::BlockMatrix hessian = energy_.pattern();
    energy_.linearise(x, w, gradient_, &hessian);
    solver_ = std::make_unique<linalg::BlockSolver>(std::move(hessian), energy_.near_nullspace(x));
  } else {
    energy_.linearise(x, w, gradient_, keep ? nullptr : &solver_->matrix());
    if (!keep) solver_->refactor();
  }
  const Vec gradient = Eigen::Map<const Vec>(gradient_.data(), gradient_.size());
  if (!keep) {
    changes_.clear();
  } else if (!new_targets_) {
    const Vec change = gradient - last_gradient_;
    const double curvature = change.dot(last_step_);
    if (curvature > 1e-12 * change.norm() * last_step_.norm())
      changes_.push_back({last_step_, change, 1.0 / curvature});
  }
  new_targets_ = false;
  last_gradient_ = gradient;
  last_step_.resize(0);
}

// The descent direction: the two loops of limited-memory BFGS round a solve with the kept Hessian.
Points SolidNewton::descend(const NewtonOptions& options, const Poll& poll, NewtonReport& report) {
  linalg::SolveOptions solve;
  solve.tol = options.tol;
  solve.max_iter = options.max_cg;
  solve.must_converge = false;
  Points q = -gradient_;
  Eigen::Map<Vec> flat(q.data(), q.size());
  std::vector<double> share(changes_.size());
  for (std::size_t k = changes_.size(); k-- > 0;) {
    share[k] = changes_[k].inverse * changes_[k].step.dot(flat);
    flat -= share[k] * changes_[k].gradient;
  }
  Points direction = Points::Zero(q.rows(), 3);
  const linalg::SolveReport solved = solver_->solve(q, direction, solve, poll);
  Eigen::Map<Vec> d(direction.data(), direction.size());
  for (std::size_t k = 0; k < changes_.size(); ++k)
    d += (share[k] - changes_[k].inverse * changes_[k].gradient.dot(d)) * changes_[k].step;
  report.cg_iterations = solved.iterations;
  report.negative_curvature = solved.negative_curvature;
  report.cg_residual = solved.residual.size() > 0 ? solved.residual.maxCoeff() : 0.0;
  report.decrement = -(gradient_.array() * direction.array()).sum();
  return direction;
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
  renew(x, w, options.keep_hessian);
  report.gradient_norm = gradient_.norm();
  if (report.gradient_norm == 0.0) return report;
  const Points direction = descend(options, poll, report);
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
      last_step_ = report.alpha * Eigen::Map<const Vec>(direction.data(), direction.size());
      break;
    }
  }
  return report;
}

}  // namespace stretchmap::volume
