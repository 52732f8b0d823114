// Dense symmetric matrices whose factorizations are compiled once, for all sizes: Eigen's for each
// size in use took a quarter of the build.
#pragma once

#include <Eigen/Core>
#include <functional>

namespace stretchmap::linalg {

using DenseRef = Eigen::Ref<const Eigen::MatrixXd>;

// \param inverse (n, n) becomes A^-1, or is left as it is.
// \return whether A is positive definite.
bool invert_positive(const DenseRef& A, Eigen::Ref<Eigen::MatrixXd> inverse);

// \param f what becomes of an eigenvalue, given the largest absolute value of all.
// \return V f(Lambda) V' for A = V Lambda V'.
Eigen::MatrixXd map_eigenvalues(const DenseRef& A,
                                const std::function<double(double value, double largest)>& f);

}  // namespace stretchmap::linalg
