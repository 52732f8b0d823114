// Sparse symmetric positive definite systems with a fixed pattern: analyse once, refactor as often
// as the values change, solve for several right-hand sides together.
#pragma once

#include <memory>
#include <string>

#include "stretchmap/linalg/solve.hpp"

namespace stretchmap::linalg {

struct SpdOptions {
  // "direct"     L D L' by dense fronts, nested dissection or least degree: surfaces, small
  //              solids.
  // "multigrid"  conjugate gradients with smoothed aggregation: solids; cost linear in the mesh.
  // "jacobi"     conjugate gradients with the diagonal: cheapest setup, for checks.
  // "cholmod"    supernodal sparse Cholesky of SuiteSparse, in builds that have it.
  // "auto"       direct for small systems and for surface-like ones (few entries per row, small
  //              fill), else multigrid.
  std::string backend = "auto";
};

// Owns the matrix. A new set of values is written into matrix().valuePtr() and announced by
// refactor():
//
//   SpdSolver solver(std::move(A));            // analysis and first factorization
//   solver.solve(B, X);                        // X (n, k): warm start in, solution out
//   fill_values(solver.matrix().valuePtr());   // same pattern
//   solver.refactor();                         // numerical work only
//
// Same input, same bits, whatever the number of threads.
class SpdSolver {
 public:
  // \pre A square, compressed, structurally symmetric, both triangles stored, diagonal present.
  // \throws OptionError (unknown backend), MissingDependencyError (no CHOLMOD), SolverError (not
  //         symmetric, not positive definite, not finite; ids are rows where a culprit is known).
  // A is emptied: Eigen 3 copies sparse matrices where others are moved.
  explicit SpdSolver(SparseMatrix&& A, const SpdOptions& options = {});
  ~SpdSolver();
  SpdSolver(SpdSolver&&) noexcept;
  SpdSolver& operator=(SpdSolver&&) noexcept;

  // Its arrays stay where they are: solvers point into them, so values are written, never swapped.
  SparseMatrix& matrix();
  const SparseMatrix& matrix() const;

  // After the values of matrix() changed. The multigrid keeps its aggregates and patterns and only
  // renews numbers, until convergence is seen to suffer; then it starts again by itself.
  // keep_preconditioner: solve with the new values, precondition with the old ones; for a small
  // change (a direct solver and the diagonal are always renewed).
  // \throws SolverError as the constructor.
  void refactor(bool keep_preconditioner = false);

  // Solves A X = B for B (n, k), any k, starting from X (n, k). A zero right-hand side gives zero.
  // \throws SolverError if the matrix shows itself not positive definite, a value is not finite,
  //         or (must_converge) the goal is not reached.
  SolveReport solve(const RowsRef& B, Eigen::Ref<Rows> X, const SolveOptions& options = {},
                    const Poll& poll = {});

  // \return the backend chosen: as in SpdOptions, not "auto".
  const std::string& backend() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stretchmap::linalg
