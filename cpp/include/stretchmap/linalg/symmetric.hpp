// Dense symmetric matrices: factorizations that are compiled once, for all sizes, and the question
// whether a small one has one at all. Eigen's for each size in use took a quarter of the build.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <functional>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

using DenseRef = Eigen::Ref<const Eigen::MatrixXd>;

// Whether the factorization L L' of a small matrix exists; its lower triangle is read.
template <int N>
bool is_positive_definite(const Eigen::Matrix<double, N, N>& A) {
  double L[N][N];
  for (int j = 0; j < N; ++j) {
    double pivot = A(j, j);
    for (int k = 0; k < j; ++k) pivot -= L[j][k] * L[j][k];
    if (!(pivot > 0.0)) return false;
    L[j][j] = std::sqrt(pivot);
    for (int i = j + 1; i < N; ++i) {
      L[i][j] = A(i, j);
      for (int k = 0; k < j; ++k) L[i][j] -= L[i][k] * L[j][k];
      L[i][j] /= L[j][j];
    }
  }
  return true;
}

// \param inverse (n, n) becomes A^-1, or is left as it is.
// \return whether A is positive definite.
bool invert_positive(const DenseRef& A, Eigen::Ref<Eigen::MatrixXd> inverse);

// \param f what becomes of an eigenvalue, given the largest absolute value of all.
// \return V f(Lambda) V' for A = V Lambda V'.
Eigen::MatrixXd map_eigenvalues(const DenseRef& A,
                                const std::function<double(double value, double largest)>& f);

// \return A W A' for the diagonal matrix W of the weights.
Rows weighted_gram(const Rows& A, const VecRef& weights);

// A' W A for a tall matrix A, as in normal equations. All processors and numbers of threads give
// the same bits.
Rows normal_matrix(const RowsRef& A, const VecRef& weights);

// The solution of a positive definite system. All processors and numbers of threads give the same
// bits.
Vec solve_dense(const RowsRef& A, const VecRef& b);

}  // namespace stretchmap::linalg
