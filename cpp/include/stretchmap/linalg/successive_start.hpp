// Where to start with like systems that are solved one after the other.
#pragma once

#include <array>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// The last solution, moved along what the last few steps have changed it by, as far as lowers the
// new system's energy most (P. F. Fischer, Projection techniques for iterative solution of Ax = b
// with successive right-hand sides, Comput. Methods Appl. Mech. Engrg. 163, 1998). Each column by
// itself. Costs what two products with the matrix do.
class SuccessiveStart {
 public:
  // \param A symmetric positive definite, both triangles stored.
  // \param X (n, 3) the last system's solution; on return where to start with A X = B.
  void improve(const SparseMatrix& A, const PointsRef& B, Points& X);

 private:
  static constexpr int kChanges = 3;

  Points last_;
  std::array<Points, kChanges> changes_;  // the newest first
  int known_ = 0;                         // so many of them
};

}  // namespace stretchmap::linalg
