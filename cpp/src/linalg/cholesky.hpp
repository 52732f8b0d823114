// Sparse Cholesky with a reused symbolic analysis.
#pragma once

#include <Eigen/SparseCholesky>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

class Cholesky {
 public:
  // \throws SolverError if A is not positive definite or not finite.
  explicit Cholesky(const SparseMatrix& A);
  void refactor(const SparseMatrix& A);
  // X = A^-1 B for K interleaved columns (K = 1, 2, 4); B and X may be the same array.
  template <int K>
  void solve(const double* B, double* X);

 private:
  using ColumnMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;
  Eigen::SimplicialLLT<ColumnMatrix, Eigen::Lower, Eigen::AMDOrdering<Index>> factor_;
  std::vector<double> work_;
};

}  // namespace stretchmap::linalg
