// What every linear solve is asked and what it answers.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

struct SolveOptions {
  double tol = 1e-10;         // goal for |b - A x| / |b| of every right-hand side, Euclidean norm
  int max_iter = 500;         // conjugate-gradient steps (a direct solve: at most 3 refinements)
  bool must_converge = true;  // a goal not reached: true: SolverError, false: see SolveReport
  // Besides, conjugate gradients go on until the last step lowers the quadratic x'Ax / 2 - b'x, and
  // was promised to by the preconditioner, by no more than this share of what a step did on
  // average. Where entries differ by orders of magnitude, the residual is that of the largest
  // alone. 0: the residual decides.
  double energy_share = 0.0;
};

struct SolveReport {
  int iterations = 0;      // of the slowest right-hand side; 0: the start was good enough
  Vec residual;            // true |b - A x| / |b| per right-hand side, computed afresh
  bool converged = false;  // residual <= tol for all of them
  bool negative_curvature =
      false;  // block solver only: stopped because A was seen to be indefinite
};

}  // namespace stretchmap::linalg
