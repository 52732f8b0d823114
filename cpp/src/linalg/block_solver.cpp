#include "stretchmap/linalg/block_solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "convergence_watch.hpp"
#include "multigrid.hpp"
#include "ordering.hpp"
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
  std::vector<Block> inverse;  // jacobi: of the diagonal blocks
  Rows modes;                  // multigrid: three or six columns, zero in rows that do not exist
  std::vector<Index> order;    // multigrid: order[new] = old
  bool hierarchy = false;
  ConvergenceWatch watch;
  Multigrid<3, 3> translations_only;
  Multigrid<3, 6> rigid;

  bool multigrid() const { return options.preconditioner == "multigrid"; }
  void invert_diagonal();
  void mask_modes();
  template <class Hierarchy>
  void factor(Hierarchy& multigrid);
  PcgResult<1> solve(const double* b, double* x, const SolveOptions& solve_options,
                     const Poll& poll);
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
  if (state_->multigrid()) {
    state_->modes = near_nullspace;
    state_->mask_modes();
  }
  refactor();
}

BlockSolver::BlockSolver(BlockMatrix A, const BlockOptions& options)
    : BlockSolver(std::move(A), translations(A.rows()), options) {}

BlockSolver::~BlockSolver() = default;
BlockSolver::BlockSolver(BlockSolver&&) noexcept = default;
BlockSolver& BlockSolver::operator=(BlockSolver&&) noexcept = default;

BlockMatrix& BlockSolver::matrix() { return state_->A; }
const BlockMatrix& BlockSolver::matrix() const { return state_->A; }

// An unknown without any coupling takes no part in the modes.
void BlockSolver::State::mask_modes() {
  for (Index i = 0; i < A.rows(); ++i) {
    bool coupled[3] = {false, false, false};
    for (Index e = A.row_ptr[i]; e < A.row_ptr[i + 1]; ++e)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          coupled[r] =
              coupled[r] || ((A.col[e] != i || r != c) &&
                             A.values[9 * static_cast<Eigen::Index>(e) + 3 * r + c] != 0.0);
    for (int r = 0; r < 3; ++r)
      if (!coupled[r]) modes.row(3 * static_cast<Eigen::Index>(i) + r).setZero();
  }
}

// The inverse diagonal blocks, which must be positive definite.
void BlockSolver::State::invert_diagonal() {
  const Index n = A.rows();
  inverse.resize(static_cast<std::size_t>(n));
  std::vector<char> good(static_cast<std::size_t>(n), 0);
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Index* first = A.col.data() + A.row_ptr[i];
      const Index* last = A.col.data() + A.row_ptr[i + 1];
      const Index* found = std::lower_bound(first, last, i);
      if (found == last || *found != i) continue;
      const Eigen::Map<const Block> block(A.values.data() + 9 * (found - A.col.data()));
      const Eigen::LLT<Eigen::Matrix3d> llt(block);
      good[i] = block.allFinite() && llt.info() == Eigen::Success;
      inverse[i] = llt.solve(Eigen::Matrix3d::Identity());
    }
  });
  std::vector<Index> bad;
  for (Index i = 0; i < n && bad.size() < 20; ++i)
    if (!good[i]) bad.push_back(i);
  if (!bad.empty())
    throw Error("SolverError",
                "the diagonal block of vertex " + std::to_string(bad[0]) +
                    " is missing or not positive definite",
                bad);
}

template <class Hierarchy>
void BlockSolver::State::factor(Hierarchy& multigrid) {
  if (!hierarchy) {
    order = breadth_first_order(A.rows(), A.row_ptr.data(), A.col.data());
    multigrid.finest().set_pattern(A.rows(), A.row_ptr.data(), A.col.data(), order);
  }
  multigrid.finest().set_values(A.values.data());
  if (hierarchy && !watch.worn()) {
    multigrid.refresh();
    return;
  }
  const Eigen::Index width = 3 * modes.cols();
  std::vector<double> ordered(static_cast<std::size_t>(modes.size()));
  for (std::size_t i = 0; i < order.size(); ++i)
    std::copy_n(modes.data() + width * order[i], width, ordered.data() + width * i);
  multigrid.setup(ordered);
  hierarchy = true;
  watch.reset();
}

void BlockSolver::refactor() {
  State& s = *state_;
  s.invert_diagonal();
  if (!s.multigrid()) return;
  if (s.modes.cols() == 3)
    s.factor(s.translations_only);
  else
    s.factor(s.rigid);
}

// Everything here is in the numbering of `order`.
PcgResult<1> BlockSolver::State::solve(const double* b, double* x,
                                       const SolveOptions& solve_options, const Poll& poll) {
  const Index n = A.rows();
  PcgSystem system;
  system.n = 3 * n;
  const auto use = [&](auto& multigrid) {
    system.apply = [&](const double* in, double* out) {
      multigrid.finest().template multiply<1>(in, out);
    };
    system.precondition = [&](const double* in, double* out) {
      multigrid.template precondition<1>(in, out);
    };
  };
  if (!multigrid()) {
    system.apply = [&](const double* in, double* out) { multiply(A, in, out); };
    system.precondition = [&](const double* in, double* out) {
      for_chunks(n, [&](Index begin, Index end) {
        for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
          Eigen::Map<Eigen::Vector3d>(out + 3 * i) =
              inverse[i] * Eigen::Map<const Eigen::Vector3d>(in + 3 * i);
      });
    };
  } else if (modes.cols() == 3) {
    use(translations_only);
  } else {
    use(rigid);
  }
  const PcgResult<1> result = pcg<1>(system, b, x, solve_options, poll);
  watch.observe(result.iterations, result.digits);
  return result;
}

SolveReport BlockSolver::solve(const PointsRef& b, Eigen::Ref<Points> x,
                               const SolveOptions& options, const Poll& poll) {
  State& s = *state_;
  const Index n = s.A.rows();
  if (b.rows() != n || x.rows() != n)
    throw Error("SolverError", "right-hand side and solution must have a row per vertex");
  const auto old_row = [&](Index i) { return s.order.empty() ? i : s.order[i]; };
  Points ordered_b(n, 3), ordered_x(n, 3);
  for (Index i = 0; i < n; ++i) {
    ordered_b.row(i) = b.row(old_row(i));
    ordered_x.row(i) = x.row(old_row(i));
  }
  const PcgResult<1> result = s.solve(ordered_b.data(), ordered_x.data(), options, poll);
  if (!result.finite)
    throw Error("SolverError", "a value that is not finite appeared while solving");
  for (Index i = 0; i < n; ++i) x.row(old_row(i)) = ordered_x.row(i);
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
