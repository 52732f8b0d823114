// The step between two levels: smoothed prolongation, its transpose, and the coarse matrix P'AP.
#pragma once

#include "linalg/multigrid/aggregation.hpp"

namespace stretchmap::linalg {

// From K unknowns per aggregate to B unknowns per fine row. It is made once: it serves later values
// of A as well, nearly as well as one made of them, and a third of the work is saved.
template <int B, int K>
struct Transfer {
  Pattern p, r;           // prolongation and its transpose
  Buffer<float> p_value;  // row-major B x K blocks
  Buffer<float> r_value;  // the same blocks in the order of r
  Pattern ap, coarse;     // patterns of A P and of P'AP (with the diagonal)

  // P = (I - damping D^-1 A) T, weak scalar entries of A being added to its diagonal; T has
  // orthonormal columns within each aggregate.
  // modes (n B K): near-nullspace of A, row-major. Returns the modes of the coarse level.
  std::vector<double> setup(const LevelMatrix<B>& A, const std::vector<double>& modes,
                            double threshold, double damping);
  // Values of P'AP in the order of `coarse`, row-major K x K blocks.
  Buffer<double> coarse_values(const LevelMatrix<B>& A) const;

  // b = P' r, N columns.
  template <int N>
  void restrict_to(const float* r_fine, float* b) const;
  // y = x + P c, N columns.
  template <int N>
  void prolong_add(const float* c, const float* x, float* y) const;

 private:
  // Returns the entry of p behind each entry of r.
  Buffer<Index> set_patterns(const LevelMatrix<B>& A, const Aggregates& aggregates);
  void set_prolongation(const LevelMatrix<B>& A, const Aggregates& aggregates,
                        const std::vector<double>& tentative, double damping);
  void multiply_rows(const LevelMatrix<B>& A, Index first, Index last, double* product) const;
  void keep_regular(Buffer<double>& values) const;
};

}  // namespace stretchmap::linalg
