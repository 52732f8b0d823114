#include "linalg/direct/cholmod.hpp"

#include "linalg/direct/refined_solve.hpp"
#include "stretchmap/base/errors.hpp"

#ifdef STRETCHMAP_CHOLMOD
#include <cholmod.h>
#endif

namespace stretchmap::linalg {

#ifdef STRETCHMAP_CHOLMOD

struct Cholmod::State {
  State() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;  // L L', which refuses what is not definite
  }
  ~State() {
    if (factor) cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  // The arrays of A, both triangles stored; CHOLMOD reads the lower one. It reads compressed
  // columns, and those of a symmetric matrix are its rows.
  static cholmod_sparse view(const SparseMatrix& A) {
    cholmod_sparse matrix{};
    matrix.nrow = matrix.ncol = static_cast<std::size_t>(A.rows());
    matrix.nzmax = static_cast<std::size_t>(A.nonZeros());
    matrix.p = const_cast<Index*>(A.outerIndexPtr());
    matrix.i = const_cast<Index*>(A.innerIndexPtr());
    matrix.x = const_cast<double*>(A.valuePtr());
    matrix.stype = -1;
    matrix.itype = CHOLMOD_INT;
    matrix.xtype = CHOLMOD_REAL;
    matrix.dtype = CHOLMOD_DOUBLE;
    matrix.sorted = matrix.packed = 1;
    return matrix;
  }

  void require_success() const {
    if (common.status == CHOLMOD_OK) return;
    throw Error("SolverError",
                common.status == CHOLMOD_NOT_POSDEF
                    ? "the matrix is not positive definite (CHOLMOD met a pivot <= 0)"
                    : "CHOLMOD failed with status " + std::to_string(common.status));
  }

  cholmod_common common;
  cholmod_factor* factor = nullptr;
};

Cholmod::Cholmod(const SparseMatrix& A) : state_(std::make_unique<State>()) {
  cholmod_sparse matrix = State::view(A);
  state_->factor = cholmod_analyze(&matrix, &state_->common);
  state_->require_success();
  refactor(A);
}

Cholmod::~Cholmod() = default;

void Cholmod::refactor(const SparseMatrix& A) {
  cholmod_sparse matrix = State::view(A);
  cholmod_factorize(&matrix, state_->factor, &state_->common);
  state_->require_success();
}

void Cholmod::substitute(const double* B, double* X, int k) {
  using Columns = Eigen::MatrixXd;
  const auto n = static_cast<Eigen::Index>(state_->factor->n);
  Columns right = Eigen::Map<const Rows>(B, n, k);
  cholmod_dense b{};
  b.nrow = b.d = static_cast<std::size_t>(n);
  b.ncol = static_cast<std::size_t>(k);
  b.nzmax = b.nrow * b.ncol;
  b.x = right.data();
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, state_->factor, &b, &state_->common);
  state_->require_success();
  Eigen::Map<Rows>(X, n, k) = Eigen::Map<const Columns>(static_cast<double*>(x->x), n, k);
  cholmod_free_dense(&x, &state_->common);
}

#else

struct Cholmod::State {};

Cholmod::Cholmod(const SparseMatrix&) {
  throw Error("MissingDependencyError",
              "this build has no CHOLMOD: install SuiteSparse (apt install libsuitesparse-dev) and "
              "build with pip install . -C cmake.define.STRETCHMAP_CHOLMOD=ON, or choose auto, "
              "direct, multigrid or jacobi");
}

Cholmod::~Cholmod() = default;
void Cholmod::refactor(const SparseMatrix&) {}
void Cholmod::substitute(const double*, double*, int) {}

#endif

template <int K>
PcgResult<K> Cholmod::solve(const SparseMatrix& A, const double* B, double* X,
                            const SolveOptions& options) {
  return refined_solve<K>(A, B, X, options,
                          [this](const double* b, double* x) { substitute(b, x, K); });
}

template PcgResult<1> Cholmod::solve(const SparseMatrix&, const double*, double*,
                                     const SolveOptions&);
template PcgResult<2> Cholmod::solve(const SparseMatrix&, const double*, double*,
                                     const SolveOptions&);
template PcgResult<4> Cholmod::solve(const SparseMatrix&, const double*, double*,
                                     const SolveOptions&);

}  // namespace stretchmap::linalg
