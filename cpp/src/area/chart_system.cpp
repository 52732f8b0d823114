#include "stretchmap/area/chart_system.hpp"

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::area {

Vec ChartSystem::solve(const Rows& hessians, const Vec& gradient, const Poll& poll) {
  SparseMatrix& matrix = pattern_.matrix();
  pattern_.scatter(hessians, matrix.valuePtr());
  const double ridge = ridge_ * Vec(matrix.diagonal()).mean();
  for_rows(static_cast<Index>(matrix.rows()), [&](Index i) { matrix.coeffRef(i, i) += ridge; });
  if (poll) poll();
  solver().factorize(matrix, poll);
  return solver_->solve(-gradient);
}

linalg::BlockLdlt<2>& ChartSystem::solver() {
  if (!solver_) solver_.emplace(pattern_.matrix());
  return *solver_;
}

}  // namespace stretchmap::area
