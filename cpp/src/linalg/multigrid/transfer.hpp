// The step between two levels: smoothed prolongation, its transpose, and the coarse matrix P'AP.
#pragma once

#include "linalg/multigrid/aggregation.hpp"

namespace stretchmap::linalg {

// From K unknowns per aggregate to B unknowns per fine row. Everything but the numbers is settled
// once; set_values and coarse_values only compute numbers.
template <int B, int K>
struct Transfer {
  Aggregates aggregates;
  std::vector<double> tentative;  // (n B K) orthonormal columns within each aggregate
  Pattern p, r;                   // prolongation and its transpose
  std::vector<Index> r_entry;     // entry of p behind each entry of r
  std::vector<float> p_value;     // row-major B x K blocks
  std::vector<float> r_value;     // the same blocks in the order of r
  Pattern ap, coarse;             // patterns of A P and of P'AP (with the diagonal)
  double damping = 0.0;           // of the smoothing step

  // modes (n B K): near-nullspace of A, row-major. Returns the modes of the coarse level.
  std::vector<double> setup(const LevelMatrix<B>& A, const std::vector<double>& modes,
                            double threshold);
  // P = (I - damping D^-1 A) T, weak scalar entries of A being added to its diagonal.
  void set_values(const LevelMatrix<B>& A);
  // Values of P'AP in the order of `coarse`, row-major K x K blocks.
  std::vector<double> coarse_values(const LevelMatrix<B>& A) const;

  // b = P' r, N columns.
  template <int N>
  void restrict_to(const float* r_fine, float* b) const;
  // y = x + P c, N columns.
  template <int N>
  void prolong_add(const float* c, const float* x, float* y) const;

 private:
  std::vector<double> orthonormal(Index n, const std::vector<double>& modes);
  void set_patterns(const LevelMatrix<B>& A);
  void multiply_rows(const LevelMatrix<B>& A, Index first, Index last, double* product) const;
  void keep_regular(std::vector<double>& values) const;
};

}  // namespace stretchmap::linalg
