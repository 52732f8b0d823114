// Products with the caller's double-precision matrices.
#pragma once

#include "stretchmap/linalg/block_solver.hpp"

namespace stretchmap::linalg {

// y = A x for K interleaved columns (K = 1, 2, 4).
template <int K>
void multiply(const SparseMatrix& A, const double* x, double* y);

// y = A x for one column of 3 n unknowns.
void multiply(const BlockMatrix& A, const double* x, double* y);

}  // namespace stretchmap::linalg
