// The linear solves of Algorithm 5.1: the harmonic start (step 4) and the fixed-point step (8-9).
#pragma once

#include <memory>
#include <string>

#include "stretchmap/linalg/spd_solver.hpp"
#include "stretchmap/linalg/successive_start.hpp"
#include "stretchmap/volume/tet_laplacian.hpp"

namespace stretchmap::volume {

class VolumetricStretch {
 public:
  // \param fixed (n) marks the prescribed vertices.
  // \param rest_volumes (k) positive.
  // \param backend as in SpdOptions.
  // Image and rest volumes must be on the same scale for c of (5.6) to mean the same on every mesh.
  VolumetricStretch(const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest_volumes,
                    std::string backend);

  // \param source (n, 3) whose Laplacian it is.
  // \param x (n, 3) its free rows are replaced by the harmonic extension of the prescribed ones.
  linalg::SolveReport harmonic(const PointsRef& source, Points& x,
                               const linalg::SolveOptions& options, const Poll& poll = {});

  // One step of (5.5), warm-started from x.
  // \param c >= 0 the regularization of (5.6).
  // \param follow whether to start where the steps that led to x lead, all made with it.
  linalg::SolveReport step(Points& x, double c, bool follow, const linalg::SolveOptions& options,
                           const Poll& poll = {});

  // As in SpdOptions, not "auto"; empty before the first solve.
  std::string backend() const { return solver_ ? solver_->backend() : std::string(); }

 private:
  linalg::SolveReport solve_kept(const linalg::SolveOptions& options, const Poll& poll);
  linalg::SolveReport solve(const PointsRef& geometry, double c, bool follow, Points& x,
                            const linalg::SolveOptions& options, const Poll& poll);

  TetLaplacian laplacian_;
  std::string wanted_backend_;
  std::unique_ptr<linalg::SpdSolver> solver_;
  Points rhs_;
  Points unknowns_;
  linalg::SuccessiveStart start_;
  int solves_ = 0;    // so far
  int fresh_ = 0;     // iterations of the first solve after the preconditioner was renewed
  bool worn_ = true;  // whether the last solve took clearly more than that
};

}  // namespace stretchmap::volume
