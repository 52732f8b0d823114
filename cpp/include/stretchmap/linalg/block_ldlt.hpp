// Direct solves with symmetric matrices of small dense blocks, one block row per mesh vertex:
// Laplacians and Newton systems of surfaces. A = L D L', D diagonal, no pivoting: A has to be
// positive definite or quasi-definite ([H J'; J -C] with H and C positive definite, the unknowns in
// any order).
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

struct Dissection;

// K unknowns per block row, 1 to 3. The symbolic analysis belongs to the pattern and is done once.
template <int K>
class BlockLdlt {
 public:
  // \param A square, compressed, both triangles stored, made of full K x K blocks with the diagonal
  //        ones among them, as SurfacePattern builds it; only the pattern is read.
  explicit BlockLdlt(const SparseMatrix& A);

  // \pre the pattern given to the constructor.
  // \throws Error "SolverError" for a pivot that is zero or not finite.
  void factorize(const SparseMatrix& A, const Poll& poll = {});

  // Rows (at most 20) whose pivot is not positive; none of a positive definite matrix.
  // \pre factorize was called.
  std::vector<Index> not_positive() const;

  // Multiplications and additions of a factorize, those that fill the dense fronts left out.
  double flops() const;

  // Lets the numbers go until the next factorize.
  void let_go() { values_.reset(); }

  // \pre factorize was called.
  Vec solve(const VecRef& right) const;

 private:
  // A separator of the nested dissection, or a piece too small to be divided, or what one of least
  // degree leads to; and what it leaves.
  struct Front {
    Index first = 0, last = 0;    // its block rows, by their places in the elimination order
    std::vector<Index> children;  // fronts eliminated before
    std::vector<Index> border;    // later places its elimination fills, ascending
    Index inside = 0;             // so many of them are of the same subtree
    std::size_t start = 0;        // of its panel in values_: L below the diagonal and D on it

    Index own() const { return last - first; }
    Index size() const { return own() + static_cast<Index>(border.size()); }
  };
  using Leftover = std::unique_ptr<double[]>;  // what an eliminated front adds to later ones
  using Panel = Eigen::Map<const Eigen::MatrixXd>;

  // Fronts and their borders, in that order.
  void plan(const SparseMatrix& A, Dissection found);
  void find_borders(const SparseMatrix& A);
  void group_fronts();
  void eliminate(const SparseMatrix& A, Index front, std::vector<Leftover>& leftovers);
  Vec forward(const Front& front, Vec& x) const;
  void backward(const Front& front, Vec& x) const;

  Index n_ = 0;                                 // block rows
  std::vector<Index> place_;                    // block row -> its place in the elimination order
  std::vector<Index> order_;                    // the inverse
  std::vector<Front> fronts_;                   // children before their parents
  std::vector<std::pair<Index, Index>> trees_;  // ranges of fronts that are subtrees of their own
  std::vector<Index> top_;                      // fronts in none of them, ascending
  std::size_t total_ = 0;                       // numbers of all panels
  std::unique_ptr<double[]> values_;
};

}  // namespace stretchmap::linalg
