#include "stretchmap/linalg/spd_solver.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "linalg/direct/cholmod.hpp"
#include "linalg/direct/refined_solve.hpp"
#include "linalg/iterative.hpp"
#include "linalg/ordering.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"

namespace stretchmap::linalg {
namespace {

// A triangulated surface has 7 entries per row, a tetrahedral mesh up to 15; the fill of their
// factors differs far more. The limits are where a factorization costs as much as a multigrid
// solve.
std::string choose_backend(const SparseMatrix& A) {
  const double density = static_cast<double>(A.nonZeros()) / std::max<double>(1.0, A.rows());
  const bool surface = density < 9.0;
  return A.rows() <= (surface ? 30000 : 4000) ? "direct" : "multigrid";
}

[[noreturn]] void refuse_rows(std::vector<Index> rows) {
  throw Error("SolverError",
              "the matrix is not positive definite: row " + std::to_string(rows[0]) +
                  " has a diagonal entry that is not a positive number",
              rows);
}

void require_positive_diagonal(const SparseMatrix& A) {
  const Index n = static_cast<Index>(A.rows());
  const auto positive = [&](Index i) {
    const double value = A.coeff(i, i);
    return value > 0.0 && std::isfinite(value);
  };
  if (least_of(n, 1.0, [&](Index i) { return positive(i) ? 1.0 : 0.0; }) > 0.0) return;
  std::vector<Index> bad;
  for (Index i = 0; i < n && bad.size() < 20; ++i)
    if (!positive(i)) bad.push_back(i);
  refuse_rows(bad);
}

void factorize_positive(BlockLdlt<1>& factor, const SparseMatrix& A) {
  factor.factorize(A);
  const std::vector<Index> bad = factor.not_positive();
  if (!bad.empty())
    throw Error("SolverError", "the matrix is not positive definite: a pivot is negative", bad);
}

// Of one of the numbers that a fixed vector is made of: scattered over [0, 1).
double scattered(Index i) {
  std::uint32_t bits = (static_cast<std::uint32_t>(i) + 1u) * 0x9E3779B9u;
  bits = (bits ^ (bits >> 16)) * 0x85EBCA6Bu;
  bits = (bits ^ (bits >> 13)) * 0xC2B2AE35u;
  return static_cast<double>((bits ^ (bits >> 16)) >> 8) / (1u << 24);
}

// x'(A y) = y'(A x) for two fixed vectors, the second of scattered signs.
void require_symmetric(const SparseMatrix& A) {
  if (A.rows() != A.cols() || !A.isCompressed())
    throw Error("SolverError", "the matrix must be square and compressed");
  const Index n = static_cast<Index>(A.rows());
  Vec x(n), y(n);
  for_rows(n, [&](Index i) {
    x[i] = 0.5 + scattered(2 * i);
    y[i] = scattered(2 * i + 1) - 0.5;
  });
  const auto [left, right, scale] =
      sum_chunks<3>(n, [&](Index begin, Index end, std::array<double, 3>& sums) {
        for (Index i = begin; i < end; ++i) {
          double Ax = 0.0, Ay = 0.0;
          for (SparseMatrix::InnerIterator entry(A, i); entry; ++entry) {
            Ax += entry.value() * x[entry.col()];
            Ay += entry.value() * y[entry.col()];
          }
          sums[0] += y[i] * Ax;
          sums[1] += x[i] * Ay;
          sums[2] += std::abs(y[i] * Ax) + std::abs(x[i] * Ay);
        }
      });
  if (!std::isfinite(left + right + scale))
    throw Error("SolverError", "the matrix has an entry that is not finite");
  if (std::abs(left - right) > 1e-9 * scale)
    throw Error("SolverError", "the matrix is not symmetric");
}

}  // namespace

struct SpdSolver::State {
  SparseMatrix A;
  std::string backend;
  std::optional<BlockLdlt<1>> factor;
  std::optional<Cholmod> cholmod;
  std::optional<IterativeSolver<1, 1>> iterative;

  template <int K>
  PcgResult<K> columns(const RowsRef& B, Eigen::Ref<Rows>& X, Index first,
                       const SolveOptions& options, const Poll& poll);
  template <int K>
  void substitute(const double* b, double* x) const;
};

SpdSolver::SpdSolver(SparseMatrix&& A, const SpdOptions& options)
    : state_(std::make_unique<State>()) {
  require_symmetric(A);
  state_->A.swap(A);
  state_->backend = options.backend == "auto" ? choose_backend(state_->A) : options.backend;
  const std::string& backend = state_->backend;
  if (backend != "direct" && backend != "multigrid" && backend != "jacobi" && backend != "cholmod")
    throw Error("OptionError", "unknown solver '" + backend +
                                   "': choose auto, direct, multigrid, jacobi or cholmod");
  require_positive_diagonal(state_->A);
  refactor();
}

SpdSolver::~SpdSolver() = default;
SpdSolver::SpdSolver(SpdSolver&&) noexcept = default;
SpdSolver& SpdSolver::operator=(SpdSolver&&) noexcept = default;

SparseMatrix& SpdSolver::matrix() { return state_->A; }
const SparseMatrix& SpdSolver::matrix() const { return state_->A; }
const std::string& SpdSolver::backend() const { return state_->backend; }

void SpdSolver::refactor(bool keep_preconditioner) {
  State& s = *state_;
  if (s.backend == "direct") {
    require_positive_diagonal(s.A);
    if (!s.factor) s.factor.emplace(s.A);
    factorize_positive(*s.factor, s.A);
    return;
  }
  if (s.backend == "cholmod") {
    if (s.cholmod)
      s.cholmod->refactor(s.A);
    else
      s.cholmod.emplace(s.A);
    return;
  }
  const Index n = static_cast<Index>(s.A.rows());
  const std::size_t modes = s.backend == "multigrid" ? static_cast<std::size_t>(n) : 0;
  if (!s.iterative)
    s.iterative.emplace(n, s.A.outerIndexPtr(), s.A.innerIndexPtr(),
                        std::vector<double>(modes, 1.0),
                        breadth_first_order(n, s.A.outerIndexPtr(), s.A.innerIndexPtr()));
  const std::vector<Index> bad = s.iterative->refactor(s.A.valuePtr(), keep_preconditioner);
  if (!bad.empty()) refuse_rows(bad);
}

// x = A^-1 b, both (n, K) row-major.
template <int K>
void SpdSolver::State::substitute(const double* b, double* x) const {
  using Column = Eigen::Map<Vec, 0, Eigen::InnerStride<K>>;
  using Right = Eigen::Map<const Vec, 0, Eigen::InnerStride<K>>;
  for (int k = 0; k < K; ++k) Column(x + k, A.rows()) = factor->solve(Vec(Right(b + k, A.rows())));
}

// Solves for the columns from `first` on, at most K of them.
template <int K>
PcgResult<K> SpdSolver::State::columns(const RowsRef& B, Eigen::Ref<Rows>& X, Index first,
                                       const SolveOptions& options, const Poll& poll) {
  const int used = static_cast<int>(std::min<Eigen::Index>(K, B.cols() - first));
  if (iterative) {
    const Index stride = static_cast<Index>(B.cols());
    return iterative->template solve<K>(B.data() + first, X.data() + first, stride, used, options,
                                        poll);
  }
  using Columns =
      Eigen::Matrix<double, Eigen::Dynamic, K, K == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
  Columns b = Columns::Zero(B.rows(), K), x(B.rows(), K);
  b.leftCols(used) = B.middleCols(first, used);
  const auto direct = [&](const double* right, double* solution) {
    substitute<K>(right, solution);
  };
  const PcgResult<K> result = factor ? refined_solve<K>(A, b.data(), x.data(), options, direct)
                                     : cholmod->template solve<K>(A, b.data(), x.data(), options);
  X.middleCols(first, used) = x.leftCols(used);
  return result;
}

SolveReport SpdSolver::solve(const RowsRef& B, Eigen::Ref<Rows> X, const SolveOptions& options,
                             const Poll& poll) {
  State& s = *state_;
  if (B.rows() != s.A.rows() || X.rows() != B.rows() || X.cols() != B.cols())
    throw Error("SolverError", "right-hand side and solution must have a row per unknown");
  SolveReport report;
  report.residual = Vec::Zero(B.cols());
  Index first = 0;
  const auto take = [&](const auto& result) {
    if (!result.finite)
      throw Error("SolverError", "a value that is not finite appeared while solving");
    if (result.negative_curvature)
      throw Error("SolverError", "the matrix is not positive definite (negative curvature)");
    report.iterations = std::max(report.iterations, result.iterations);
    for (std::size_t k = 0; k < result.residual.size() && first < B.cols(); ++k)
      report.residual[first++] = result.residual[k];
  };
  while (first < B.cols()) {
    switch (padded_columns(static_cast<Index>(B.cols()) - first)) {
      case 4:
        take(s.columns<4>(B, X, first, options, poll));
        break;
      case 2:
        take(s.columns<2>(B, X, first, options, poll));
        break;
      default:
        take(s.columns<1>(B, X, first, options, poll));
    }
  }
  report.converged = (report.residual.array() <= options.tol).all();
  if (!report.converged && options.must_converge)
    throw Error("SolverError", "the linear solve stopped at a relative residual of " +
                                   scientific(report.residual.maxCoeff()) + " after " +
                                   std::to_string(report.iterations) + " iterations");
  return report;
}

}  // namespace stretchmap::linalg
