#include "stretchmap/linalg/successive_start.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {
namespace {

constexpr double kRidge = 1e-12;  // of the energies: changes can be as good as parallel

}  // namespace

void SuccessiveStart::improve(const SparseMatrix& A, const PointsRef& B, Points& X) {
  const Index n = static_cast<Index>(X.rows());
  if (last_.rows() == n) {
    std::rotate(changes_.begin(), changes_.end() - 1, changes_.end());
    changes_[0].resize(n, 3);
    for_rows(n, [&](Index i) { changes_[0].row(i) = X.row(i) - last_.row(i); });
    known_ = std::min(known_ + 1, kChanges);
  }
  last_ = X;
  if (known_ == 0) return;

  // Of each column: energies of the changes with each other, and what the residual does along them.
  constexpr int kEnergies = kChanges * kChanges, kColumn = kEnergies + kChanges;
  const auto sums = sum_chunks<3 * kColumn>(n, [&](Index begin, Index end, auto& sum) {
    for (Index i = begin; i < end; ++i) {
      Eigen::Array3d residual = B.row(i).transpose().array();
      std::array<Eigen::Array3d, kChanges> product;
      product.fill(Eigen::Array3d::Zero());
      for (SparseMatrix::InnerIterator entry(A, i); entry; ++entry) {
        residual -= entry.value() * X.row(entry.col()).transpose().array();
        for (int k = 0; k < known_; ++k)
          product[k] += entry.value() * changes_[k].row(entry.col()).transpose().array();
      }
      for (int k = 0; k < known_; ++k)
        for (int c = 0; c < 3; ++c) {
          const double way = changes_[k](i, c);
          for (int l = 0; l <= k; ++l) sum[c * kColumn + k * kChanges + l] += way * product[l](c);
          sum[c * kColumn + kEnergies + k] += way * residual(c);
        }
    }
  });
  Eigen::Matrix<double, kChanges, 3> by = Eigen::Matrix<double, kChanges, 3>::Zero();
  for (int c = 0; c < 3; ++c) {
    Eigen::MatrixXd energy(known_, known_);
    Eigen::VectorXd along(known_);
    for (int k = 0; k < known_; ++k) {
      for (int l = 0; l <= k; ++l)
        energy(k, l) = energy(l, k) = sums[c * kColumn + k * kChanges + l];
      energy(k, k) *= 1.0 + kRidge;
      along(k) = sums[c * kColumn + kEnergies + k];
    }
    const Eigen::LDLT<Eigen::MatrixXd> factor(energy);
    const Eigen::VectorXd found = factor.solve(along);
    if (factor.isPositive() && found.allFinite()) by.col(c).head(known_) = found;
  }
  for_rows(n, [&](Index i) {
    for (int k = 0; k < known_; ++k) X.row(i) += by.row(k).cwiseProduct(changes_[k].row(i));
  });
}

}  // namespace stretchmap::linalg
