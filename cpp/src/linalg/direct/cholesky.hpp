// Sparse Cholesky with a reused symbolic analysis.
#pragma once

#include <Eigen/SparseCholesky>

#include "linalg/krylov/pcg.hpp"

namespace stretchmap::linalg {

using ColumnMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;

// One class for L L' and L D L', as what they share takes a compiler longer than what they do not.
using SparseFactor =
    Eigen::SimplicialCholesky<ColumnMatrix, Eigen::Lower, Eigen::AMDOrdering<Index>>;

class Cholesky {
 public:
  // \throws SolverError if A is not positive definite.
  explicit Cholesky(const SparseMatrix& A);
  void refactor(const SparseMatrix& A);

  // X = A^-1 B, B and X (n, K) row-major, refined: see refined_solve.hpp.
  template <int K>
  PcgResult<K> solve(const SparseMatrix& A, const double* B, double* X,
                     const SolveOptions& options);

 private:
  template <int K>
  void substitute(const double* B, double* X);
  SparseFactor factor_;
  std::vector<double> work_;
};

}  // namespace stretchmap::linalg
