// Sparse Cholesky by CHOLMOD, in builds that have it.
#pragma once

#include <memory>

#include "linalg/krylov/pcg.hpp"

namespace stretchmap::linalg {

class Cholmod {
 public:
  // \throws MissingDependencyError in a build without CHOLMOD, SolverError if A is not positive
  //         definite.
  explicit Cholmod(const SparseMatrix& A);
  ~Cholmod();

  // Keeps the symbolic analysis. \throws SolverError as the constructor.
  void refactor(const SparseMatrix& A);

  // X = A^-1 B, B and X (n, K) row-major, refined: see refined_solve.hpp.
  template <int K>
  PcgResult<K> solve(const SparseMatrix& A, const double* B, double* X,
                     const SolveOptions& options);

 private:
  void substitute(const double* B, double* X, int k);

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stretchmap::linalg
