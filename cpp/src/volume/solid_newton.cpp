#include "stretchmap/volume/solid_newton.hpp"

#include <cmath>
#include <iterator>
#include <optional>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/linalg/backtrack.hpp"

namespace stretchmap::volume {
namespace {

using linalg::BlockMatrix;
using Block = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;

// Of the diagonal, one after the other until a step is found.
constexpr double kShifts[] = {0.0, 1e-8, 1e-4, 1e-1, 10.0};
// A step that single stiff elements cut shorter than that is followed by ones with the first of
// these shifts, until they serve: it holds what is stiffest, and lets all else move.
constexpr double kCutShort = 1e-2;
constexpr double kRounding = 1e-12;   // a predicted decrease that is no more of the energy is none
constexpr double kEnergyShare = 0.2;  // see SolveOptions
constexpr int kTries = 21;            // of the line search
constexpr int kProjected = 8;        // new Hessians without negative parts after one was indefinite
constexpr double kRise = 0.01;       // of the decrease predicted, by a single element: uphill
constexpr double kWorthwhile = 0.2;  // of the decrease predicted
constexpr double kHeldUp = 0.5;      // a shorter step is worth a look at who holds it up

// Adds a share of its mean to the diagonal of every diagonal block.
void stiffen(BlockMatrix& A, double share) {
  if (share == 0.0) return;
  for_rows(A.rows(), [&](Index row) {
    for (Index e = A.row_ptr[row]; e < A.row_ptr[row + 1]; ++e) {
      if (A.col[e] != row) continue;
      Block block(A.values.data() + 9 * static_cast<std::ptrdiff_t>(e));
      block.diagonal().array() += share * std::max(block.trace() / 3.0, 1e-300);
    }
  });
}

}  // namespace

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

// If single tets cut the step short: the others' whole step, theirs shortened, where that is lower.
void SolidNewton::try_held_back(Points& x, const Points& start, Points& direction,
                                const EnergyWeights& w, NewtonReport& report) const {
  std::optional<Points> shortened = energy_.held_back(start, direction);
  if (!shortened) return;
  Points trial = energy_.move(start, *shortened, 1.0);
  const EnergyReport there = energy_.value(trial, w);
  if (!(there.energy < report.after.energy)) return;
  x = std::move(trial);
  direction = std::move(*shortened);
  report.after = there;
  report.alpha = 1.0;
}

// The Hessian and its preconditioner. Sums of terms of very different size can come out indefinite
// in rounding, so the diagonal grows until they serve; false if the matrix is not even finite.
bool SolidNewton::linearize(const PointsRef& x, const EnergyWeights& w) {
  negative_ = w.negative;
  for (const double shift : kShifts) {
    try {
      if (solver_) {
        energy_.model(x, w, gradient_, &solver_->matrix());
        stiffen(solver_->matrix(), shift);
        solver_->refactor();
      } else {
        BlockMatrix hessian = energy_.pattern();
        energy_.model(x, w, gradient_, &hessian);
        stiffen(hessian, shift);
        solver_ = std::make_unique<linalg::BlockSolver>(
            std::move(hessian), energy_.near_nullspace(x), linalg::BlockOptions{"multigrid", true});
      }
      return true;
    } catch (const Error&) {
      if (!gradient_.allFinite()) return false;
    }
  }
  return false;
}

// Gradient at x, and the Hessian or what the last step tells about its change.
bool SolidNewton::renew(const PointsRef& x, const EnergyWeights& w, bool keep) {
  keep = keep && solver_ && last_step_.size() > 0;
  if (keep) {
    energy_.model(x, w, gradient_, nullptr);
  } else {
    changes_.clear();
    if (!linearize(x, w)) return false;
  }
  const Vec gradient = Eigen::Map<const Vec>(gradient_.data(), gradient_.size());
  if (keep && !new_targets_) {
    Change change{last_step_.cast<float>(), (gradient - last_gradient_).cast<float>(), 0.0};
    const Eigen::VectorXf &step = change.step, &difference = change.gradient;
    const double curvature = step.cast<double>().dot(difference.cast<double>());
    if (curvature > 1e-12 * double(difference.norm()) * double(step.norm())) {
      change.inverse = 1.0 / curvature;
      changes_.push_back(std::move(change));
    }
  }
  new_targets_ = false;
  last_gradient_ = gradient;
  last_step_.resize(0);
  return true;
}

// The descent direction: the two loops of limited-memory BFGS round a solve with the kept Hessian.
// False if the solve broke down.
bool SolidNewton::descend(const NewtonOptions& options, const Poll& poll, Points& direction,
                          NewtonReport& report) {
  linalg::SolveOptions solve;
  solve.tol = options.tol;
  solve.max_iter = options.max_cg;
  solve.must_converge = false;
  solve.energy_share = kEnergyShare;
  Points q = -gradient_;
  Eigen::Map<Vec> flat(q.data(), q.size());
  std::vector<double> share(changes_.size());
  for (std::size_t k = changes_.size(); k-- > 0;) {
    share[k] = changes_[k].inverse * changes_[k].step.cast<double>().dot(flat);
    flat -= share[k] * changes_[k].gradient.cast<double>();
  }
  direction = Points::Zero(q.rows(), 3);
  linalg::SolveReport solved;
  try {
    solved = solver_->solve(q, direction, solve, poll);
  } catch (const Error&) {
    return false;
  }
  Eigen::Map<Vec> d(direction.data(), direction.size());
  for (std::size_t k = 0; k < changes_.size(); ++k) {
    const double now = changes_[k].inverse * changes_[k].gradient.cast<double>().dot(d);
    d += (share[k] - now) * changes_[k].step.cast<double>();
  }
  report.cg_iterations += solved.iterations;
  report.negative_curvature = solved.negative_curvature;
  report.cg_residual = solved.residual.size() > 0 ? solved.residual.maxCoeff() : 0.0;
  report.decrement = -(gradient_.array() * direction.array()).sum();
  return report.decrement > 0.0 && std::isfinite(report.decrement);
}

// If single elements go uphill: the others' whole step, theirs shortened.
void SolidNewton::try_eased(Points& x, const Points& start, Points& direction,
                            const EnergyWeights& w, NewtonReport& report) const {
  EasedStep eased =
      energy_.eased(start, direction, w, kRise * report.decrement, kWorthwhile * report.decrement);
  report.held_up = std::move(eased.held_up);
  if (!(eased.there.energy < report.after.energy)) return;
  x = std::move(eased.image);
  direction = std::move(eased.step);
  report.after = eased.there;
  report.alpha = 1.0;
}

bool SolidNewton::search(Points& x, Points& direction, const EnergyWeights& w, const Poll& poll,
                         NewtonReport& report) {
  const Points start = x;
  const double longest = w.epsilon > 0.0 ? 1.0 : energy_.longest_step(x, direction);
  Points trial;
  EnergyReport there;
  const double alpha =
      linalg::backtrack(report.before.energy, -report.decrement, longest, kTries, [&](double t) {
        if (poll) poll();
        trial = energy_.move(start, direction, t);
        there = energy_.value(trial, w);
        return there.energy;
      });
  if (poll) poll();
  if (alpha > 0.0) {
    x = std::move(trial);
    report.after = there;
    report.alpha = alpha;
    if (alpha == longest) try_double_step(x, start, direction, w, report);
  }
  if (w.epsilon <= 0.0 && report.alpha < kHeldUp) try_held_back(x, start, direction, w, report);
  if (w.face > 0.0 && report.alpha < kHeldUp) try_eased(x, start, direction, w, report);
  if (report.alpha == 0.0) return false;
  last_step_ = report.alpha * Eigen::Map<const Vec>(direction.data(), direction.size());
  return true;
}

// After a direction of negative curvature. The projected Hessian has none; where it was in use, it
// is the preconditioner that has one, and is renewed.
bool SolidNewton::solve_projected(const PointsRef& x, EnergyWeights w, const NewtonOptions& options,
                                  const Poll& poll, Points& direction, NewtonReport& report) {
  changes_.clear();
  const bool projected = negative_ == 0.0;
  if (!projected) projected_ = kProjected;
  w.negative = 0.0;
  if (projected)
    solver_->refactor();
  else if (!linearize(x, w))
    return false;
  return descend(options, poll, direction, report);
}

// As a rule the step begins where the last one ended.
EnergyReport SolidNewton::start_value(const PointsRef& x, const EnergyWeights& w) {
  const EnergyWeights& last = end_weights_;
  const bool same = w.shape == last.shape && w.volume == last.volume && w.face == last.face &&
                    w.epsilon == last.epsilon && w.soft == 0.0 && last.soft == 0.0;
  return same && end_.rows() == x.rows() && end_ == x ? end_report_ : energy_.value(x, w);
}

NewtonReport SolidNewton::step(Points& x, const EnergyWeights& weights,
                               const NewtonOptions& options, const Poll& poll) {
  NewtonReport report;
  EnergyWeights w = weights;
  w.negative = projected_ > 0 ? 0.0 : options.negative;
  if (projected_ > 0 && !options.keep_hessian) --projected_;
  energy_.soften(x, w.epsilon > 0.0 ? w.soft : 0.0);
  report.before = report.after = start_value(x, w);
  if (!std::isfinite(report.before.energy))
    throw Error("SolverError", "the energy is infinite: " + std::to_string(report.before.flips) +
                                   " inverted tets and " + std::to_string(report.before.folds) +
                                   " folded boundary faces; untangle first");
  if (energy_.rows() == 0) return report;
  if (!renew(x, w, options.keep_hessian)) return report;
  if (gradient_.norm() == 0.0) return report;
  Points direction;
  const std::size_t first = cut_short_ ? 1 : 0;
  for (std::size_t k = first; k < std::size(kShifts); ++k) {
    const double shift = kShifts[k];
    if (shift > 0.0) {
      stiffen(solver_->matrix(), shift);
      solver_->refactor();
      changes_.clear();
    }
    report.shift = shift;
    bool down = descend(options, poll, direction, report);
    if (report.negative_curvature && k == first)
      down = solve_projected(x, w, options, poll, direction, report);
    if (!down) continue;
    if (search(x, direction, w, poll, report)) break;
    if (report.decrement <= kRounding * std::abs(report.before.energy)) break;
  }
  cut_short_ = report.alpha < kCutShort || (cut_short_ && report.alpha < kHeldUp);
  end_ = x;
  end_weights_ = w;
  end_report_ = report.after;
  return report;
}

}  // namespace stretchmap::volume
