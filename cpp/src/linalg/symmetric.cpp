#include "stretchmap/linalg/symmetric.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

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

}  // namespace stretchmap::linalg
