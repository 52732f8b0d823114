#include "stretchmap/area/chart_system.hpp"

namespace stretchmap::area {

Vec ChartSystem::solve(const Rows& hessians, const Vec& gradient, const Poll& poll) {
  SparseMatrix matrix = pattern_.zeros();
  pattern_.scatter(hessians, matrix.valuePtr());
  const double ridge = ridge_ * Vec(matrix.diagonal()).mean();
  for (Index i = 0; i < matrix.rows(); ++i) matrix.coeffRef(i, i) += ridge;
  if (poll) poll();
  if (!solver_) solver_.emplace(matrix);
  solver_->factorize(matrix, poll);
  return solver_->solve(-gradient);
}

}  // namespace stretchmap::area
