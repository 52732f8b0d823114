#include "stretchmap/linalg/block_solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "parallel.hpp"
#include "pcg.hpp"
#include "spmv.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap {

using namespace linalg;
using Block = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Rows translations(Index n) {
  Rows modes = Rows::Zero(3 * static_cast<Eigen::Index>(n), 3);
  for (Index i = 0; i < n; ++i) modes.middleRows<3>(3 * static_cast<Eigen::Index>(i)).setIdentity();
  return modes;
}

Rows rigid_body_modes(const PointsRef& points) {
  const Eigen::RowVector3d centre = points.colwise().mean();
  const double scale = (points.rowwise() - centre).rowwise().norm().maxCoeff();
  Rows modes = Rows::Zero(3 * points.rows(), 6);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Eigen::RowVector3d p = (points.row(i) - centre) / (scale > 0.0 ? scale : 1.0);
    modes.block<3, 3>(3 * i, 0).setIdentity();
    for (int axis = 0; axis < 3; ++axis)
      modes.block<3, 1>(3 * i, 3 + axis) = Eigen::Vector3d::Unit(axis).cross(p.transpose());
  }
  return modes;
}

struct BlockSolver::State {
  BlockMatrix A;
  BlockOptions options;
  std::vector<Block> inverse;  // of the diagonal blocks
};

BlockSolver::BlockSolver(BlockMatrix A, const RowsRef& near_nullspace, const BlockOptions& options)
    : state_(std::make_unique<State>()) {
  if (options.preconditioner != "multigrid" && options.preconditioner != "jacobi")
    throw Error("OptionError", "unknown preconditioner '" + options.preconditioner +
                                   "': choose multigrid or jacobi");
  if (near_nullspace.rows() != 3 * static_cast<Eigen::Index>(A.rows()) ||
      (near_nullspace.cols() != 3 && near_nullspace.cols() != 6))
    throw Error("SolverError",
                "the near-nullspace must have three rows per vertex, 3 or 6 columns");
  state_->A = std::move(A);
  state_->options = options;
  refactor();
}

BlockSolver::BlockSolver(BlockMatrix A, const BlockOptions& options)
    : BlockSolver(std::move(A), translations(A.rows()), options) {}

BlockSolver::~BlockSolver() = default;
BlockSolver::BlockSolver(BlockSolver&&) noexcept = default;
BlockSolver& BlockSolver::operator=(BlockSolver&&) noexcept = default;

BlockMatrix& BlockSolver::matrix() { return state_->A; }
const BlockMatrix& BlockSolver::matrix() const { return state_->A; }

void BlockSolver::refactor() {
  State& s = *state_;
  const Index n = s.A.rows();
  s.inverse.resize(static_cast<std::size_t>(n));
  std::vector<char> good(static_cast<std::size_t>(n), 0);
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Index* first = s.A.col.data() + s.A.row_ptr[i];
      const Index* last = s.A.col.data() + s.A.row_ptr[i + 1];
      const Index* found = std::lower_bound(first, last, i);
      if (found == last || *found != i) continue;
      const Eigen::Map<const Block> block(s.A.values.data() + 9 * (found - s.A.col.data()));
      const Eigen::LLT<Eigen::Matrix3d> llt(block);
      good[i] = block.allFinite() && llt.info() == Eigen::Success;
      s.inverse[i] = llt.solve(Eigen::Matrix3d::Identity());
    }
  });
  std::vector<Index> bad;
  for (Index i = 0; i < n && bad.size() < 20; ++i)
    if (!good[i]) bad.push_back(i);
  if (!bad.empty())
    throw Error("SolverError",
                "the diagonal block of vertex " + std::to_string(bad[0]) +
                    " is missing or not positive definite",
                std::move(bad));
}

SolveReport BlockSolver::solve(const PointsRef& b, Eigen::Ref<Points> x,
                               const SolveOptions& options, const Poll& poll) {
  State& s = *state_;
  const Index n = s.A.rows();
  if (b.rows() != n || x.rows() != n)
    throw Error("SolverError", "right-hand side and solution must have a row per vertex");
  const auto jacobi = [&](const double* in, double* out) {
    for_chunks(n, [&](Index begin, Index end) {
      for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
        Eigen::Map<Eigen::Vector3d>(out + 3 * i) =
            s.inverse[i] * Eigen::Map<const Eigen::Vector3d>(in + 3 * i);
    });
  };
  const PcgSystem system{3 * n, [&](const double* in, double* out) { multiply(s.A, in, out); },
                         jacobi};
  const PcgResult<1> result = pcg<1>(system, b.data(), x.data(), options, poll);
  if (!result.finite)
    throw Error("SolverError", "a value that is not finite appeared while solving");
  SolveReport report;
  report.iterations = result.iterations;
  report.residual = Vec::Constant(1, result.residual[0]);
  report.negative_curvature = result.negative_curvature;
  report.converged = !report.negative_curvature && report.residual[0] <= options.tol;
  if (!report.converged && !report.negative_curvature && options.must_converge)
    throw Error("SolverError", "the block solve stopped at a relative residual of " +
                                   std::to_string(report.residual[0]) + " after " +
                                   std::to_string(report.iterations) + " iterations");
  return report;
}

}  // namespace stretchmap
