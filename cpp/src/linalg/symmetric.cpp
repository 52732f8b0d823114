#include "stretchmap/linalg/symmetric.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

// The vectors of reflections become their product in place. Eigen does the same, step for step,
// behind a choice at run time whose other side, in blocks and never taken here, is half of what
// there is to compile in this file.
template <>
struct Eigen::internal::tridiagonalization_inplace_selector<Eigen::MatrixXd, Eigen::Dynamic,
                                                            false> {
  static void run(MatrixXd& A, VectorXd& diagonal, VectorXd& below, VectorXd& factors,
                  bool vectors) {
    tridiagonalization_inplace(A, factors);
    diagonal = A.diagonal();
    below = A.diagonal<-1>();
    if (!vectors) return;
    const Index n = A.rows();
    VectorXd work(n);
    A.diagonal().setOnes();
    A.triangularView<StrictlyUpper>().setZero();
    for (Index k = n - 2; k >= 0; --k) {
      const Index size = n - k - 1;
      const Block<const MatrixXd, Dynamic, 1> essential(A, k + 2, k, size - 1, 1);
      A.bottomRightCorner(size, size).applyHouseholderOnTheLeft(essential, factors[k], work.data());
      A.col(k).tail(size).setZero();
    }
  }
};

namespace stretchmap::linalg {

bool invert_positive(const DenseRef& A, Eigen::Ref<Eigen::MatrixXd> inverse) {
  const Eigen::LLT<Eigen::MatrixXd> llt(A);
  if (llt.info() != Eigen::Success) return false;
  inverse.setIdentity();
  llt.solveInPlace(inverse);
  return true;
}

Eigen::MatrixXd map_eigenvalues(const DenseRef& A, const std::function<double(double, double)>& f) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(A);
  Eigen::VectorXd values = eigen.eigenvalues();
  const double largest = values.cwiseAbs().maxCoeff();
  for (double& value : values) value = f(value, largest);
  return eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
}

Rows weighted_gram(const Rows& A, const VecRef& weights) {
  return A * weights.asDiagonal() * A.transpose();
}

}  // namespace stretchmap::linalg
