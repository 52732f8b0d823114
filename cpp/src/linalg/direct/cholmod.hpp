// Sparse Cholesky by CHOLMOD, in builds that have it.
#pragma once

#include <memory>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

class Cholmod {
 public:
  // \throws MissingDependencyError in a build without CHOLMOD, SolverError if A is not positive
  //         definite.
  explicit Cholmod(const SparseMatrix& A);
  ~Cholmod();

  // Keeps the symbolic analysis. \throws SolverError as the constructor.
  void refactor(const SparseMatrix& A);

  // X = A^-1 B, B and X (n, k) row-major.
  void substitute(const double* B, double* X, int k);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stretchmap::linalg
