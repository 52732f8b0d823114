// Iterative refinement of a direct solve. Plain loops: expressions of Eigen, compiled for every K,
// took several per cent of the build.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "linalg/krylov/pcg.hpp"

namespace stretchmap::linalg {

template <int K>
std::array<double, K> column_norms(const double* V, Eigen::Index n) {
  std::array<double, K> norms{};
  for (Eigen::Index i = 0; i < n; ++i)
    for (int k = 0; k < K; ++k) norms[k] += V[K * i + k] * V[K * i + k];
  for (double& norm : norms) norm = std::sqrt(norm);
  return norms;
}

// R = B - A X; returns the norms of its columns.
template <int K>
std::array<double, K> residual_norms(const SparseMatrix& A, const double* B, const double* X,
                                     double* R) {
  const Index* column = A.innerIndexPtr();
  const double* value = A.valuePtr();
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    double* r = R + K * i;
    for (int k = 0; k < K; ++k) r[k] = B[K * i + k];
    for (Index e = A.outerIndexPtr()[i]; e < A.outerIndexPtr()[i + 1]; ++e)
      for (int k = 0; k < K; ++k)
        r[k] -= value[e] * X[K * static_cast<Eigen::Index>(column[e]) + k];
  }
  return column_norms<K>(R, A.rows());
}

// X = A^-1 B, B and X (n, K) row-major, by substitute(b, x) and then at most three steps of
// refinement towards the goal; the result's iterations count these.
template <int K, class Substitute>
PcgResult<K> refined_solve(const SparseMatrix& A, const double* B, double* X,
                           const SolveOptions& options, const Substitute& substitute) {
  const auto size = static_cast<std::size_t>(A.rows()) * K;
  std::vector<double> residual(size), correction(size);
  const auto sum = [](const std::array<double, K>& norms) {
    double total = 0.0;
    for (const double norm : norms) total += norm;
    return total;
  };
  PcgResult<K> result;
  substitute(B, X);
  const std::array<double, K> goal = column_norms<K>(B, A.rows());
  std::array<double, K> error = residual_norms<K>(A, B, X, residual.data());
  const auto short_of_goal = [&] {
    for (int k = 0; k < K; ++k)
      if (error[k] > options.tol * goal[k]) return true;
    return false;
  };
  while (result.iterations < std::min(3, options.max_iter) && short_of_goal()) {
    substitute(residual.data(), correction.data());
    for (std::size_t i = 0; i < size; ++i) correction[i] += X[i];
    const auto refined = residual_norms<K>(A, B, correction.data(), residual.data());
    if (!(sum(refined) < sum(error))) break;
    std::copy(correction.begin(), correction.end(), X);
    error = refined;
    ++result.iterations;
  }
  for (int k = 0; k < K; ++k) result.residual[k] = goal[k] > 0.0 ? error[k] / goal[k] : 0.0;
  result.finite = std::isfinite(sum(error)) &&
                  std::all_of(X, X + size, [](double value) { return std::isfinite(value); });
  return result;
}

}  // namespace stretchmap::linalg
