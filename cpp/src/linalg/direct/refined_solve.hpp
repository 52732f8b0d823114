// Iterative refinement of a direct solve.
#pragma once

#include <algorithm>

#include "linalg/krylov/pcg.hpp"

namespace stretchmap::linalg {

// X = A^-1 B, B and X (n, K) row-major, by substitute(b, x) and then at most three steps of
// refinement towards the goal; the result's iterations count these.
template <int K, class Substitute>
PcgResult<K> refined_solve(const SparseMatrix& A, const double* B, double* X,
                           const SolveOptions& options, const Substitute& substitute) {
  using Columns =
      Eigen::Matrix<double, Eigen::Dynamic, K, K == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
  const Eigen::Map<const Columns> b(B, A.rows(), K);
  Eigen::Map<Columns> x(X, A.rows(), K);
  PcgResult<K> result;
  substitute(B, X);
  Columns residual = b - A * x, correction(A.rows(), K);
  const auto size = b.colwise().norm().eval();
  auto error = residual.colwise().norm().eval();
  while (result.iterations < std::min(3, options.max_iter) &&
         (error.array() > options.tol * size.array()).any()) {
    substitute(residual.data(), correction.data());
    const Columns refined = x + correction;
    residual = b - A * refined;
    const auto refined_error = residual.colwise().norm().eval();
    if (!(refined_error.sum() < error.sum())) break;
    x = refined;
    error = refined_error;
    ++result.iterations;
  }
  for (int k = 0; k < K; ++k) result.residual[k] = size[k] > 0.0 ? error[k] / size[k] : 0.0;
  result.finite = x.allFinite() && error.allFinite();
  return result;
}

}  // namespace stretchmap::linalg
