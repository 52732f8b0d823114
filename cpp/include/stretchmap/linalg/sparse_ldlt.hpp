// Sparse symmetric systems that need not be positive definite, solved once.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// X becomes A^-1 X by a factorization L D L', or is left as it is.
//
// \param A (n, n), compressed, both triangles stored.
// \param X (n, k), the right-hand sides.
// \return whether there is one with this order of the pivots.
bool solve_ldlt(const SparseMatrix& A, Rows& X);

}  // namespace stretchmap::linalg
