// Symmetric systems of 3x3 blocks, one block row per mesh vertex: the Newton systems of the
// flip-free optimization.
#pragma once

#include <memory>
#include <string>

#include "stretchmap/linalg/solve.hpp"

namespace stretchmap::linalg {

// Block compressed rows. Entry e of block row i (row_ptr[i] <= e < row_ptr[i + 1]) is the 3x3 block
// at block column col[e], row-major in values[9 e .. 9 e + 8]. Columns ascend within a row; both
// triangles and every diagonal block are stored. A degree of freedom that does not exist (a fixed
// vertex, the normal of a gliding one) has a row and a column of the identity. Rows that are
// coupled should have close numbers: smoothing follows them.
struct BlockMatrix {
  IndexVec row_ptr;  // (n + 1)
  IndexVec col;      // (n_blocks)
  Vec values;        // (9 n_blocks)

  Index rows() const { return static_cast<Index>(row_ptr.size()) - 1; }
};

struct BlockOptions {
  // "multigrid"  smoothed aggregation on the near-nullspace
  // "jacobi"     inverse diagonal blocks
  std::string preconditioner = "multigrid";
  // Rows that are coupled have close numbers: they need not be renumbered for smoothing, and all
  // that is made of the matrix reads it in one go.
  bool ordered = false;
};

// \return (3 n, 3) displacements that cost (next to) no energy, as columns over the 3 n unknowns:
//         three translations.
Rows translations(Index n);

// \return (3 n, 6) three translations and three infinitesimal rotations of the points.
Rows rigid_body_modes(const PointsRef& points);

// Conjugate gradients for one right-hand side, made for inexact Newton steps.
class BlockSolver {
 public:
  // near_nullspace (3 n, 3 or 6): translations(n) if the unknowns of every vertex are Cartesian;
  // where a vertex has its own frame Q (columns: its axes) its three rows are Q' times those of
  // the Cartesian mode. Rows of unknowns that do not exist are ignored.
  // \throws OptionError, SolverError (a diagonal block not positive definite, not finite; ids are
  //         block rows).
  BlockSolver(BlockMatrix A, const RowsRef& near_nullspace, const BlockOptions& options = {});
  explicit BlockSolver(BlockMatrix A, const BlockOptions& options = {});  // translations
  ~BlockSolver();
  BlockSolver(BlockSolver&&) noexcept;
  BlockSolver& operator=(BlockSolver&&) noexcept;

  BlockMatrix& matrix();
  const BlockMatrix& matrix() const;

  // After matrix().values changed (same pattern): renews numbers on the old hierarchy, which is
  // built again when convergence is seen to suffer.
  // \param keep_preconditioner solve with the new values, precondition with the old ones.
  void refactor(bool keep_preconditioner = false);

  // Solves A x = b for b (n, 3), from x (n, 3). Should a direction of negative curvature turn up,
  // the last iterate before it is kept, and at the first step x plus the preconditioned residual:
  // from x = 0 and with b = -gradient either is a descent direction. The report says so; it is no
  // error. \throws SolverError if a value is not finite or (must_converge) the goal is not reached.
  SolveReport solve(const PointsRef& b, Eigen::Ref<Points> x, const SolveOptions& options = {},
                    const Poll& poll = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stretchmap::linalg
