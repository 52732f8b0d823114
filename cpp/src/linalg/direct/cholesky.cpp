#include "linalg/direct/cholesky.hpp"

#include "linalg/direct/refined_solve.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap::linalg {
namespace {

// A symmetric matrix in compressed rows is itself in compressed columns.
template <class Matrix>
Eigen::Map<const Matrix> as_columns(const SparseMatrix& A) {
  return {A.rows(), A.cols(), A.nonZeros(), A.outerIndexPtr(), A.innerIndexPtr(), A.valuePtr()};
}

}  // namespace

Cholesky::Cholesky(const SparseMatrix& A) {
  factor_.analyzePattern(as_columns<ColumnMatrix>(A));
  refactor(A);
}

void Cholesky::refactor(const SparseMatrix& A) {
  factor_.factorize(as_columns<ColumnMatrix>(A));
  if (factor_.info() != Eigen::Success)
    throw Error("SolverError", "the matrix is not positive definite (Cholesky met a pivot <= 0)");
}

template <int K>
void Cholesky::substitute(const double* B, double* X) {
  // The factor in compressed columns, diagonal first in each; P A P' = L L'.
  const ColumnMatrix& L = factor_.matrixL().nestedExpression();
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

}  // namespace stretchmap::linalg
