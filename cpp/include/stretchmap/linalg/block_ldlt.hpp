// Direct solves with symmetric matrices of small dense blocks, one block row per mesh vertex: the
// Newton systems of surfaces. A = L D L', D diagonal, no pivoting: A has to be positive definite or
// quasi-definite ([H J'; J -C] with H and C positive definite, the unknowns in any order).
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// K unknowns per block row, 2 or 3. The symbolic analysis belongs to the pattern and is done once.
template <int K>
class BlockLdlt {
 public:
  // \param A square, compressed, both triangles stored, made of full K x K blocks with the diagonal
  //        ones among them, as SurfacePattern builds it; only the pattern is read.
  explicit BlockLdlt(const SparseMatrix& A);

  // \pre the pattern given to the constructor.
  // \throws Error "SolverError" for a pivot that is zero or not finite.
  void factorize(const SparseMatrix& A, const Poll& poll = {});

  // \pre factorize was called.
  Vec solve(const VecRef& right) const;

 private:
  using Block = Eigen::Matrix<double, K, K>;
  using Part = Eigen::Matrix<double, K, 1>;

  Index n_ = 0;                 // block rows
  std::vector<Index> place_;    // old block row -> its place in the elimination order
  std::vector<Index> order_;    // the inverse
  std::vector<Index> parent_;   // elimination tree
  std::vector<Index> start_;    // (n + 1) columns of L
  std::vector<Index> row_;      // row of each block of L, ascending in a column
  std::vector<Block> lower_;    // blocks of L below the diagonal
  std::vector<Block> unit_;     // the diagonal blocks of L
  std::vector<Part> diagonal_;  // D
};

}  // namespace stretchmap::linalg
