// Sparse Cholesky with a reused symbolic analysis.
#pragma once

#include <Eigen/SparseCholesky>

#include "linalg/krylov/pcg.hpp"

namespace stretchmap::linalg {

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
  using ColumnMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;
  Eigen::SimplicialLLT<ColumnMatrix, Eigen::Lower, Eigen::AMDOrdering<Index>> factor_;
  std::vector<double> work_;
};

}  // namespace stretchmap::linalg
