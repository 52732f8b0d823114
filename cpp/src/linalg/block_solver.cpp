#include "stretchmap/linalg/block_solver.hpp"

#include <optional>
#include <utility>

#include "linalg/iterative.hpp"
#include "linalg/ordering.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {

Rows translations(Index n) {
  Rows modes = Rows::Zero(3 * static_cast<Eigen::Index>(n), 3);
  for (Index i = 0; i < n; ++i) modes.middleRows<3>(3 * static_cast<Eigen::Index>(i)).setIdentity();
  return modes;
}

Rows rigid_body_modes(const PointsRef& points) {
  const Eigen::RowVector3d center = points.colwise().mean();
  const double scale = (points.rowwise() - center).rowwise().norm().maxCoeff();
  Rows modes = Rows::Zero(3 * points.rows(), 6);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Eigen::RowVector3d p = (points.row(i) - center) / (scale > 0.0 ? scale : 1.0);
    modes.block<3, 3>(3 * i, 0).setIdentity();
    for (int axis = 0; axis < 3; ++axis)
      modes.block<3, 1>(3 * i, 3 + axis) = Eigen::Vector3d::Unit(axis).cross(p.transpose());
  }
  return modes;
}

struct BlockSolver::State {
  BlockMatrix A;
  std::optional<IterativeSolver<3, 3>> small;  // three modes, or the diagonal alone
  std::optional<IterativeSolver<3, 6>> large;  // six modes
};

namespace {

// Columns in range and ascending, the diagonal among them.
bool row_is_sound(const BlockMatrix& A, Index i) {
  const Index begin = A.row_ptr[i], end = A.row_ptr[i + 1];
  if (begin > end || end > A.col.size()) return false;
  bool diagonal = false;
  Index last = -1;
  for (Index e = begin; e < end; last = A.col[e++]) {
    if (A.col[e] <= last || A.col[e] >= A.rows()) return false;
    diagonal = diagonal || A.col[e] == i;
  }
  return diagonal;
}

void require_pattern(const BlockMatrix& A) {
  const Index n = A.rows();
  if (n < 0 || A.row_ptr[0] != 0 || A.row_ptr[n] != A.col.size() ||
      A.values.size() != 9 * A.col.size())
    throw Error("SolverError", "the arrays of the block matrix do not belong together");
  std::vector<Index> bad;
  for (Index i = 0; i < n && bad.size() < 20; ++i)
    if (!row_is_sound(A, i)) bad.push_back(i);
  if (!bad.empty())
    throw Error("SolverError",
                "block row " + std::to_string(bad[0]) +
                    " has no diagonal block, or columns out of range or order",
                bad);
}

// The modes, zero for an unknown without any coupling: it takes no part in them.
std::vector<double> masked_modes(const BlockMatrix& A, const RowsRef& near_nullspace) {
  std::vector<double> modes(near_nullspace.data(), near_nullspace.data() + near_nullspace.size());
  const auto width = static_cast<std::size_t>(near_nullspace.cols());
  for_rows(A.rows(), kElementChunk, [&](Index i) {
    bool coupled[3] = {false, false, false};
    for (Index e = A.row_ptr[i]; e < A.row_ptr[i + 1]; ++e)
      for (int k = 0; k < 9; ++k)
        if ((A.col[e] != i || k % 4 != 0) && A.values[9 * static_cast<Eigen::Index>(e) + k] != 0.0)
          coupled[k / 3] = true;
    for (std::size_t r = 0; r < 3; ++r)
      if (!coupled[r]) std::fill_n(modes.data() + (3 * i + r) * width, width, 0.0);
  });
  return modes;
}

}  // namespace

BlockSolver::BlockSolver(BlockMatrix A, const RowsRef& modes_given, const BlockOptions& options)
    : state_(std::make_unique<State>()) {
  const Rows standard = modes_given.cols() == 0 ? translations(A.rows()) : Rows();
  const RowsRef near_nullspace = modes_given.cols() == 0 ? RowsRef(standard) : modes_given;
  if (options.preconditioner != "multigrid" && options.preconditioner != "jacobi")
    throw Error("OptionError", "unknown preconditioner '" + options.preconditioner +
                                   "': choose multigrid or jacobi");
  require_pattern(A);
  if (near_nullspace.rows() != 3 * static_cast<Eigen::Index>(A.rows()) ||
      (near_nullspace.cols() != 3 && near_nullspace.cols() != 6))
    throw Error("SolverError",
                "the near-nullspace must have three rows per vertex, 3 or 6 columns");
  State& s = *state_;
  s.A = std::move(A);
  std::vector<double> modes;
  if (options.preconditioner == "multigrid") modes = masked_modes(s.A, near_nullspace);
  const Index n = s.A.rows(), *start = s.A.row_ptr.data(), *col = s.A.col.data();
  std::vector<Index> order;
  if (!options.ordered) order = breadth_first_order(n, start, col);
  if (near_nullspace.cols() == 3 || modes.empty())
    s.small.emplace(n, start, col, std::move(modes), std::move(order));
  else
    s.large.emplace(n, start, col, std::move(modes), std::move(order));
  refactor();
}

BlockSolver::BlockSolver(BlockMatrix A, const BlockOptions& options)
    : BlockSolver(std::move(A), Rows(), options) {}

BlockSolver::~BlockSolver() = default;
BlockSolver::BlockSolver(BlockSolver&&) noexcept = default;
BlockSolver& BlockSolver::operator=(BlockSolver&&) noexcept = default;

BlockMatrix& BlockSolver::matrix() { return state_->A; }
const BlockMatrix& BlockSolver::matrix() const { return state_->A; }

void BlockSolver::refactor(bool keep_preconditioner) {
  State& s = *state_;
  const double* values = s.A.values.data();
  const std::vector<Index> bad = s.small ? s.small->refactor(values, keep_preconditioner)
                                         : s.large->refactor(values, keep_preconditioner);
  if (!bad.empty())
    throw Error(
        "SolverError",
        "the diagonal block of vertex " + std::to_string(bad[0]) + " is not positive definite",
        bad);
}

SolveReport BlockSolver::solve(const PointsRef& b, Eigen::Ref<Points> x,
                               const SolveOptions& options, const Poll& poll) {
  State& s = *state_;
  if (b.rows() != s.A.rows() || x.rows() != b.rows())
    throw Error("SolverError", "right-hand side and solution must have a row per vertex");
  const PcgResult<1> result = s.small ? s.small->solve<1>(b.data(), x.data(), 1, 1, options, poll)
                                      : s.large->solve<1>(b.data(), x.data(), 1, 1, options, poll);
  if (!result.finite)
    throw Error("SolverError", "a value that is not finite appeared while solving");
  SolveReport report;
  report.iterations = result.iterations;
  report.residual = Vec::Constant(1, result.residual[0]);
  report.negative_curvature = result.negative_curvature;
  report.converged = !report.negative_curvature && report.residual[0] <= options.tol;
  if (!report.converged && !report.negative_curvature && options.must_converge)
    throw Error("SolverError", "the block solve stopped at a relative residual of " +
                                   scientific(report.residual[0]) + " after " +
                                   std::to_string(report.iterations) + " iterations");
  return report;
}

}  // namespace stretchmap::linalg
