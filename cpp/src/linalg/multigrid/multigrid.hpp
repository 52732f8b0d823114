// Smoothed-aggregation multigrid: one V-cycle in single precision as a preconditioner.
#pragma once

#include <vector>

#include "linalg/multigrid/dense_inverse.hpp"
#include "linalg/multigrid/level_matrix.hpp"
#include "linalg/multigrid/transfer.hpp"

namespace stretchmap::linalg {

template <int B, int K>
struct Level {
  LevelMatrix<B> A;
  Transfer<B, K> transfer;
  std::vector<float> b, x;          // right-hand side and correction, used below the finest level
  std::vector<float> smooth, work;  // after the first sweep; residual, then corrected

  // \return what the smoothing of the prolongation is damped by.
  double damping() const;
  template <int N>
  void descend(const float* right_hand_side, std::vector<float>& coarse_b);
  template <int N>
  void ascend(const float* right_hand_side, const std::vector<float>& coarse_x, float* out);
};

// B unknowns per row on the finest level, K (near-nullspace modes) on the others.
template <int B, int K>
class Multigrid {
 public:
  // The finest matrix; its values are set before setup and refresh.
  LevelMatrix<B>& finest() { return finest_.A; }
  const LevelMatrix<B>& finest() const { return finest_.A; }

  // modes (n B K): near-nullspace in the finest matrix's numbering.
  void setup(const std::vector<double>& modes);
  // New values, the old prolongations.
  void refresh();

  // z = M r for N interleaved columns; M symmetric positive definite up to rounding.
  template <int N>
  void precondition(const float* r, float* z);

  // change = A z - r after that, of one column.
  void unbalanced(const float* z, float* change);

 private:
  Level<B, K> finest_;
  std::vector<Level<K, K>> coarse_;
  Pattern last_pattern_;
  DenseInverse last_;
  std::vector<float> last_b_, last_x_;
};

}  // namespace stretchmap::linalg
