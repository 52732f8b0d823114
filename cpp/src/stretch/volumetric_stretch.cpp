#include "stretchmap/stretch/volumetric_stretch.hpp"

#include <utility>

namespace stretchmap {

VolumetricStretch::VolumetricStretch(const TetsRef& tets, const FlagsRef& fixed,
                                     const VecRef& rest_volumes, std::string backend)
    : laplacian_(tets, fixed, rest_volumes), wanted_backend_(std::move(backend)) {}

SolveReport VolumetricStretch::solve(const PointsRef& geometry, double c, Points& x,
                                     const SolveOptions& options, const Poll& poll) {
  Points rhs;
  if (!solver_) {
    SparseMatrix matrix = laplacian_.pattern();
    laplacian_.assemble(geometry, c, x, matrix, rhs);
    solver_ = std::make_unique<SpdSolver>(std::move(matrix), SpdOptions{wanted_backend_});
  } else {
    laplacian_.assemble(geometry, c, x, solver_->matrix(), rhs);
    solver_->refactor();
  }
  const IndexVec& interior = laplacian_.interior();
  Rows unknowns(interior.size(), 3);
  for (Index i = 0; i < interior.size(); ++i) unknowns.row(i) = x.row(interior[i]);
  const SolveReport report = solver_->solve(rhs, unknowns, options, poll);
  for (Index i = 0; i < interior.size(); ++i) x.row(interior[i]) = unknowns.row(i);
  return report;
}

SolveReport VolumetricStretch::harmonic(const PointsRef& source, Points& x,
                                        const SolveOptions& options, const Poll& poll) {
  return solve(source, 0.0, x, options, poll);
}

SolveReport VolumetricStretch::step(Points& x, double c, const SolveOptions& options,
                                    const Poll& poll) {
  return solve(x, c, x, options, poll);
}

}  // namespace stretchmap
