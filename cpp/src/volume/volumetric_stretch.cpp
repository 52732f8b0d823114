#include "stretchmap/volume/volumetric_stretch.hpp"

#include <algorithm>
#include <utility>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::volume {
namespace {

// The matrix of a step differs little from that of the step before, except for the first ones; its
// preconditioner serves until it costs a fifth more iterations. Renewing it takes as long as five.
constexpr int kSettling = 4;
constexpr double kWorn = 1.2;

}  // namespace

VolumetricStretch::VolumetricStretch(const TetsRef& tets, const FlagsRef& fixed,
                                     const VecRef& rest_volumes, std::string backend)
    : laplacian_(tets, fixed, rest_volumes), wanted_backend_(std::move(backend)) {}

// Solves with the preconditioner of an earlier step; where that has become slow, renews it and goes
// on from there.
linalg::SolveReport VolumetricStretch::solve_kept(const linalg::SolveOptions& options,
                                                  const Poll& poll) {
  solver_->refactor(true);
  linalg::SolveOptions trial = options;
  trial.max_iter = std::min(options.max_iter, 2 * fresh_);
  trial.must_converge = false;
  linalg::SolveReport report = solver_->solve(rhs_, unknowns_, trial, poll);
  worn_ = report.iterations > kWorn * fresh_;
  if (report.converged) return report;
  solver_->refactor();
  const int spent = report.iterations;
  report = solver_->solve(rhs_, unknowns_, options, poll);
  report.iterations += spent;
  return report;
}

linalg::SolveReport VolumetricStretch::solve(const PointsRef& geometry, double c, bool follow,
                                             Points& x, const linalg::SolveOptions& options,
                                             const Poll& poll) {
  const bool first = !solver_;
  if (first) {
    SparseMatrix matrix = laplacian_.pattern();
    laplacian_.assemble(geometry, c, x, matrix, rhs_);
    solver_ =
        std::make_unique<linalg::SpdSolver>(std::move(matrix), linalg::SpdOptions{wanted_backend_});
  } else {
    laplacian_.assemble(geometry, c, x, solver_->matrix(), rhs_);
  }
  const IndexVec& interior = laplacian_.interior();
  unknowns_.resize(static_cast<Eigen::Index>(interior.size()), 3);
  const Index n = static_cast<Index>(interior.size());
  for_rows(n, [&](Index i) { unknowns_.row(i) = x.row(interior[i]); });
  if (follow && backend() != "direct") start_.improve(solver_->matrix(), rhs_, unknowns_);
  linalg::SolveReport report;
  if (solves_++ < kSettling || worn_ || backend() == "direct") {
    if (!first) solver_->refactor();
    report = solver_->solve(rhs_, unknowns_, options, poll);
    fresh_ = report.iterations;
    worn_ = false;
  } else {
    report = solve_kept(options, poll);
  }
  for_rows(n, [&](Index i) { x.row(interior[i]) = unknowns_.row(i); });
  return report;
}

linalg::SolveReport VolumetricStretch::harmonic(const PointsRef& source, Points& x,
                                                const linalg::SolveOptions& options,
                                                const Poll& poll) {
  return solve(source, 0.0, false, x, options, poll);
}

linalg::SolveReport VolumetricStretch::step(Points& x, double c, bool follow,
                                            const linalg::SolveOptions& options, const Poll& poll) {
  return solve(x, c, follow, x, options, poll);
}

}  // namespace stretchmap::volume
