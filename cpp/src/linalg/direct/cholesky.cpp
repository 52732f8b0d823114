#include "linalg/direct/cholesky.hpp"

#include "linalg/direct/refined_solve.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/linalg/sparse_ldlt.hpp"

namespace stretchmap::linalg {
namespace {

// A symmetric matrix in compressed rows is itself in compressed columns.
Eigen::Map<const ColumnMatrix> as_columns(const SparseMatrix& A) {
  return {A.rows(), A.cols(), A.nonZeros(), A.outerIndexPtr(), A.innerIndexPtr(), A.valuePtr()};
}

}  // namespace

Cholesky::Cholesky(const SparseMatrix& A) {
  factor_.setMode(Eigen::SimplicialCholeskyLLT);
  factor_.analyzePattern(as_columns(A));
  refactor(A);
}

void Cholesky::refactor(const SparseMatrix& A) {
  factor_.factorize(as_columns(A));
  if (factor_.info() != Eigen::Success)
    throw Error("SolverError", "the matrix is not positive definite (Cholesky met a pivot <= 0)");
}

template <int K>
void Cholesky::substitute(const double* B, double* X) {
  // The factor in compressed columns, diagonal first in each; P A P' = L L'.
  const ColumnMatrix& L = factor_.rawMatrix();
  const Index n = static_cast<Index>(L.cols());
  const Index* start = L.outerIndexPtr();
  const Index* row = L.innerIndexPtr();
  const double* value = L.valuePtr();
  const auto& permute = factor_.permutationP().indices();
  work_.resize(static_cast<std::size_t>(n) * K);
  double* w = work_.data();
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
    for (int k = 0; k < K; ++k) w[static_cast<std::size_t>(K) * permute[i] + k] = B[K * i + k];
  for (Index j = 0; j < n; ++j) {
    double* wj = w + static_cast<std::size_t>(K) * j;
    for (int k = 0; k < K; ++k) wj[k] /= value[start[j]];
    for (Index e = start[j] + 1; e < start[j + 1]; ++e)
      for (int k = 0; k < K; ++k) w[static_cast<std::size_t>(K) * row[e] + k] -= value[e] * wj[k];
  }
  for (Index j = n - 1; j >= 0; --j) {
    double* wj = w + static_cast<std::size_t>(K) * j;
    double sum[K];
    for (int k = 0; k < K; ++k) sum[k] = wj[k];
    for (Index e = start[j] + 1; e < start[j + 1]; ++e)
      for (int k = 0; k < K; ++k) sum[k] -= value[e] * w[static_cast<std::size_t>(K) * row[e] + k];
    for (int k = 0; k < K; ++k) wj[k] = sum[k] / value[start[j]];
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
    for (int k = 0; k < K; ++k) X[K * i + k] = w[static_cast<std::size_t>(K) * permute[i] + k];
}

template <int K>
PcgResult<K> Cholesky::solve(const SparseMatrix& A, const double* B, double* X,
                             const SolveOptions& options) {
  return refined_solve<K>(A, B, X, options,
                          [this](const double* b, double* x) { substitute<K>(b, x); });
}

template PcgResult<1> Cholesky::solve(const SparseMatrix&, const double*, double*,
                                      const SolveOptions&);
template PcgResult<2> Cholesky::solve(const SparseMatrix&, const double*, double*,
                                      const SolveOptions&);
template PcgResult<4> Cholesky::solve(const SparseMatrix&, const double*, double*,
                                      const SolveOptions&);

bool solve_ldlt(const SparseMatrix& A, Rows& X) {
  SparseFactor factor;
  factor.setMode(Eigen::SimplicialCholeskyLDLT);
  factor.compute(as_columns(A));
  if (factor.info() != Eigen::Success) return false;
  // The factor in compressed columns, without its diagonal of ones; P A P' = L D L'.
  const ColumnMatrix& L = factor.rawMatrix();
  const Index n = static_cast<Index>(L.cols());
  const Index* start = L.outerIndexPtr();
  const Index* row = L.innerIndexPtr();
  const double* value = L.valuePtr();
  const auto& permute = factor.permutationP().indices();
  const auto pivots = factor.vectorD();
  Vec w(n);
  for (Index c = 0; c < X.cols(); ++c) {
    for (Index i = 0; i < n; ++i) w[permute[i]] = X(i, c);
    for (Index j = 0; j < n; ++j)
      for (Index e = start[j]; e < start[j + 1]; ++e) w[row[e]] -= value[e] * w[j];
    for (Index j = n - 1; j >= 0; --j) {
      w[j] *= 1.0 / pivots[j];
      for (Index e = start[j]; e < start[j + 1]; ++e) w[j] -= value[e] * w[row[e]];
    }
    for (Index i = 0; i < n; ++i) X(i, c) = w[permute[i]];
  }
  return true;
}

}  // namespace stretchmap::linalg
