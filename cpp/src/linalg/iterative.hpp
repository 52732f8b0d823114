// Conjugate gradients on the caller's matrix, preconditioned by the diagonal blocks or by multigrid
// of a rescaled copy in single precision, renumbered if its order is not local.
#pragma once

#include <vector>

#include "linalg/block_rows.hpp"
#include "linalg/krylov/convergence_watch.hpp"
#include "linalg/krylov/pcg.hpp"
#include "linalg/multigrid/multigrid.hpp"

namespace stretchmap::linalg {

// Columns solved together; three right-hand sides travel as four, the last one zero.
inline int padded_columns(Index k) { return k >= 3 ? 4 : static_cast<int>(k); }

// B unknowns per block row, M near-nullspace modes.
template <int B, int M>
class IterativeSolver {
 public:
  // Pattern in compressed rows, with the diagonal; it has to outlive this, like the values below.
  // modes (n B M), row-major; empty: the diagonal blocks alone precondition. order: a numbering in
  // which neighbors are close, order[new] = old; empty: they are.
  IterativeSolver(Index n, const Index* start, const Index* col, std::vector<double> modes,
                  std::vector<Index> order);

  // Values in the pattern's order, row-major blocks. keep: the preconditioner stays as it is.
  // Returns rows whose diagonal block is not positive definite; with any the solver is unusable.
  std::vector<Index> refactor(const double* values, bool keep);

  // Row r of column k is b[stride r + k], k < used <= K; the columns from `used` on are zero.
  template <int K>
  PcgResult<K> solve(const double* b, double* x, Index stride, int used,
                     const SolveOptions& options, const Poll& poll);

 private:
  void set_scale();
  template <int K>
  void precondition(const float* r, float* z);
  template <int K>
  void precondition_in_order(const float* r, float* z);
  // Its scale is a power of two that brings the diagonal near one: single precision needs it, and
  // what the preconditioner promises is measured against what steps gain.
  BlockRows<B> matrix_;
  std::vector<Index> order_;  // order_[new] = old, block rows; empty: the same
  std::vector<double> modes_;
  Multigrid<B, M> multigrid_;  // with the diagonal alone only its finest level is used
  ConvergenceWatch watch_;
  bool ready_ = false;
  bool kept_ =
      false;  // the hierarchy belongs to earlier values: how it does says nothing of its age
  bool stiff_ = false;                // a solve drifted without products
  Buffer<double> inner_b_, inner_x_;  // kept, like the vectors, for the next solve
  Buffer<float> renumbered_r_, renumbered_z_;
  PcgVectors vectors_;
};

}  // namespace stretchmap::linalg
