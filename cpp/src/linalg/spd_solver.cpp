#include "stretchmap/linalg/spd_solver.hpp"

#include <cmath>
#include <optional>
#include <utility>

#include "cholesky.hpp"
#include "convergence_watch.hpp"
#include "multigrid.hpp"
#include "ordering.hpp"
#include "parallel.hpp"
#include "pcg.hpp"
#include "spmv.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap {
namespace {

using namespace linalg;

// A triangulated surface has 7 entries per row, a tetrahedral mesh up to 15; the fill of their
// factors differs far more. The limits are where a factorisation costs as much as a multigrid
// solve.
std::string choose_backend(const SparseMatrix& A) {
  const double density = static_cast<double>(A.nonZeros()) / std::max<double>(1.0, A.rows());
  const bool surface = density < 9.0;
  return A.rows() <= (surface ? 30000 : 4000) ? "direct" : "multigrid";
}

// The inverse diagonal; its rows must be positive for any backend.
Vec inverse_diagonal(const SparseMatrix& A) {
  const Vec diagonal = A.diagonal();
  std::vector<Index> bad;
  for (Index i = 0; i < A.rows(); ++i)
    if (!(diagonal[i] > 0.0 && std::isfinite(diagonal[i])) && bad.size() < 20) bad.push_back(i);
  if (!bad.empty())
    throw Error("SolverError",
                "the matrix is not positive definite: row " + std::to_string(bad[0]) +
                    " has a diagonal entry that is not a positive number",
                bad);
  return diagonal.cwiseInverse();
}

// x'(A y) = y'(A x) for two fixed vectors of scattered signs.
void require_symmetric(const SparseMatrix& A) {
  if (A.rows() != A.cols() || !A.isCompressed())
    throw Error("SolverError", "the matrix must be square and compressed");
  const Index n = static_cast<Index>(A.rows());
  Vec x(n), y(n), Ax(n), Ay(n);
  std::uint32_t state = 12345;
  for (Index i = 0; i < n; ++i) {
    state = state * 1664525u + 1013904223u;
    x[i] = 0.5 + static_cast<double>(state >> 8) / (1u << 24);
    state = state * 1664525u + 1013904223u;
    y[i] = static_cast<double>(state >> 8) / (1u << 24) - 0.5;
  }
  multiply<1>(A, x.data(), Ax.data());
  multiply<1>(A, y.data(), Ay.data());
  const double left = y.dot(Ax), right = x.dot(Ay);
  const double scale = y.cwiseAbs().dot(Ax.cwiseAbs()) + x.cwiseAbs().dot(Ay.cwiseAbs());
  if (!std::isfinite(left + right + scale))
    throw Error("SolverError", "the matrix has an entry that is not finite");
  if (std::abs(left - right) > 1e-9 * scale)
    throw Error("SolverError", "the matrix is not symmetric");
}

}  // namespace

struct SpdSolver::State {
  SparseMatrix A;
  std::string backend;
  std::optional<Cholesky> cholesky;
  Vec inverse;               // jacobi
  std::vector<Index> order;  // multigrid: order[new] = old
  Multigrid<1, 1> multigrid;
  bool hierarchy = false;
  ConvergenceWatch watch;

  void factor_multigrid();
  template <int K>
  PcgResult<K> direct(const double* b, double* x, const SolveOptions& options);
  template <int K>
  PcgResult<K> iterative(const double* b, double* x, const SolveOptions& options, const Poll& poll);
  template <int K>
  void columns(const RowsRef& B, Eigen::Ref<Rows>& X, Index first, const SolveOptions& options,
               const Poll& poll, SolveReport& report);
};

SpdSolver::SpdSolver(SparseMatrix A, const SpdOptions& options)
    : state_(std::make_unique<State>()) {
  require_symmetric(A);
  state_->A = std::move(A);
  state_->backend = options.backend == "auto" ? choose_backend(state_->A) : options.backend;
  const std::string& backend = state_->backend;
  if (backend != "direct" && backend != "multigrid" && backend != "jacobi")
    throw Error("OptionError",
                "unknown solver '" + backend + "': choose auto, direct, multigrid or jacobi");
  refactor();
}

SpdSolver::~SpdSolver() = default;
SpdSolver::SpdSolver(SpdSolver&&) noexcept = default;
SpdSolver& SpdSolver::operator=(SpdSolver&&) noexcept = default;

SparseMatrix& SpdSolver::matrix() { return state_->A; }
const SparseMatrix& SpdSolver::matrix() const { return state_->A; }
const std::string& SpdSolver::backend() const { return state_->backend; }

void SpdSolver::refactor() {
  State& s = *state_;
  s.inverse = inverse_diagonal(s.A);
  if (s.backend == "multigrid") s.factor_multigrid();
  if (s.backend != "direct") return;
  if (s.cholesky)
    s.cholesky->refactor(s.A);
  else
    s.cholesky.emplace(s.A);
}

void SpdSolver::State::factor_multigrid() {
  const Index n = static_cast<Index>(A.rows());
  if (!hierarchy) {
    order = breadth_first_order(n, A.outerIndexPtr(), A.innerIndexPtr());
    multigrid.finest().set_pattern(n, A.outerIndexPtr(), A.innerIndexPtr(), order);
  }
  multigrid.finest().set_values(A.valuePtr());
  if (hierarchy && !watch.worn()) {
    multigrid.refresh();
    return;
  }
  multigrid.setup(std::vector<double>(order.size(), 1.0));
  hierarchy = true;
  watch.reset();
}

template <int K>
PcgResult<K> SpdSolver::State::direct(const double* b, double* x, const SolveOptions& options) {
  // Refinement: the exact solve is the preconditioner, one step is nearly always enough.
  const PcgSystem system{static_cast<Index>(A.rows()),
                         [&](const double* in, double* out) { multiply<K>(A, in, out); },
                         [&](const double* in, double* out) { cholesky->solve<K>(in, out); }};
  cholesky->solve<K>(b, x);
  SolveOptions refine = options;
  refine.max_iter = std::min(options.max_iter, 3);
  return pcg<K>(system, b, x, refine, {});
}

template <int K>
PcgResult<K> SpdSolver::State::iterative(const double* b, double* x, const SolveOptions& options,
                                         const Poll& poll) {
  const Index n = static_cast<Index>(A.rows());
  const auto jacobi = [&](const double* in, double* out) {
    for_chunks(n, [&](Index begin, Index end) {
      for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
        for (int k = 0; k < K; ++k) out[K * i + k] = inverse[i] * in[K * i + k];
    });
  };
  if (backend == "jacobi") {
    const PcgSystem system{n, [&](const double* in, double* out) { multiply<K>(A, in, out); },
                           jacobi};
    return pcg<K>(system, b, x, options, poll);
  }
  const PcgSystem system{
      n, [&](const double* in, double* out) { multigrid.finest().multiply<K>(in, out); },
      [&](const double* in, double* out) { multigrid.precondition<K>(in, out); }};
  const PcgResult<K> result = pcg<K>(system, b, x, options, poll);
  watch.observe(result.iterations, result.digits);
  return result;
}

// Solves for K columns from `first` on, those beyond the last one being zero.
template <int K>
void SpdSolver::State::columns(const RowsRef& B, Eigen::Ref<Rows>& X, Index first,
                               const SolveOptions& options, const Poll& poll, SolveReport& report) {
  using Columns =
      Eigen::Matrix<double, Eigen::Dynamic, K, K == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
  const Index used = std::min<Index>(K, static_cast<Index>(B.cols()) - first);
  Columns b = Columns::Zero(B.rows(), K), x = Columns::Zero(B.rows(), K);
  const auto old_row = [&](Index i) { return order.empty() ? i : order[i]; };
  for (Index i = 0; i < B.rows(); ++i) {
    b.row(i).head(used) = B.row(old_row(i)).segment(first, used);
    x.row(i).head(used) = X.row(old_row(i)).segment(first, used);
  }
  const PcgResult<K> result = backend == "direct" ? direct<K>(b.data(), x.data(), options)
                                                  : iterative<K>(b.data(), x.data(), options, poll);
  if (!result.finite)
    throw Error("SolverError", "a value that is not finite appeared while solving");
  if (result.negative_curvature)
    throw Error("SolverError", "the matrix is not positive definite (negative curvature)");
  for (Index i = 0; i < B.rows(); ++i) X.row(old_row(i)).segment(first, used) = x.row(i).head(used);
  report.iterations = std::max(report.iterations, result.iterations);
  for (Index k = 0; k < used; ++k) report.residual[first + k] = result.residual[k];
}

SolveReport SpdSolver::solve(const RowsRef& B, Eigen::Ref<Rows> X, const SolveOptions& options,
                             const Poll& poll) {
  State& s = *state_;
  if (B.rows() != s.A.rows() || X.rows() != B.rows() || X.cols() != B.cols())
    throw Error("SolverError", "right-hand side and solution must have a row per unknown");
  SolveReport report;
  report.residual = Vec::Zero(B.cols());
  for (Index first = 0; first < B.cols();) {
    const Index left = static_cast<Index>(B.cols()) - first;
    if (left >= 3)
      s.columns<4>(B, X, first, options, poll, report);
    else if (left == 2)
      s.columns<2>(B, X, first, options, poll, report);
    else
      s.columns<1>(B, X, first, options, poll, report);
    first += std::min<Index>(left, 4);
  }
  report.converged = (report.residual.array() <= options.tol).all();
  if (!report.converged && options.must_converge)
    throw Error("SolverError", "the linear solve stopped at a relative residual of " +
                                   std::to_string(report.residual.maxCoeff()) + " after " +
                                   std::to_string(report.iterations) + " iterations");
  return report;
}

}  // namespace stretchmap
