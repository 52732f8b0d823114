#include "stretchmap/linalg/block_ldlt.hpp"

#include <Eigen/OrderingMethods>
#include <algorithm>

#include "linalg/direct/block_update.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap::linalg {

namespace {

// Block columns of block row i, in the matrix's own numbering.
template <int K>
struct BlockRow {
  BlockRow(const SparseMatrix& A, Index i)
      : first(A.outerIndexPtr()[K * i]),
        size((A.outerIndexPtr()[K * i + 1] - first) / K),
        columns(A.innerIndexPtr() + first) {}
  Index column(Index e) const { return columns[K * e] / K; }
  Index first, size;
  const Index* columns;
};

template <int K>
std::vector<Index> minimum_degree(const SparseMatrix& A, Index n) {
  using Columns = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;
  Columns graph(n, n);
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index i = 0; i < n; ++i) {
    const BlockRow<K> row(A, i);
    for (Index e = 0; e < row.size; ++e) entries.emplace_back(row.column(e), i, 1.0);
  }
  graph.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index> order;
  Eigen::AMDOrdering<Index>()(graph, order);
  return {order.indices().data(), order.indices().data() + n};
}

// pivot = unit * diagonal * unit'. Entry by entry: the unknowns of a block may be scaled badly
// against each other, and an inverse would mix them up.
template <int K>
void factorize_pivot(Eigen::Matrix<double, K, K> pivot, Eigen::Matrix<double, K, K>& unit,
                     Eigen::Matrix<double, K, 1>& diagonal) {
  unit.setIdentity();
  for (int j = 0; j < K; ++j) {
    diagonal(j) = pivot(j, j);
    for (int i = j + 1; i < K; ++i) {
      unit(i, j) = pivot(i, j) / pivot(j, j);
      for (int c = j + 1; c <= i; ++c) pivot(i, c) -= unit(i, j) * pivot(c, j);
    }
  }
}

}  // namespace

template <int K>
BlockLdlt<K>::BlockLdlt(const SparseMatrix& A)
    : n_(static_cast<Index>(A.rows()) / K), order_(minimum_degree<K>(A, n_)) {
  place_.resize(order_.size());
  for (Index k = 0; k < n_; ++k) place_[order_[k]] = k;
  parent_.assign(order_.size(), -1);
  std::vector<Index> count(order_.size(), 0), mark(order_.size(), -1);
  for (Index k = 0; k < n_; ++k) {
    mark[k] = k;
    const BlockRow<K> row(A, order_[k]);
    for (Index e = 0; e < row.size; ++e)
      for (Index i = place_[row.column(e)]; i < k && mark[i] != k; i = parent_[i]) {
        if (parent_[i] == -1) parent_[i] = k;
        ++count[i];
        mark[i] = k;
      }
  }
  start_.assign(order_.size() + 1, 0);
  for (Index k = 0; k < n_; ++k) start_[k + 1] = start_[k] + count[k];
  row_.resize(start_[n_]);
  lower_.resize(start_[n_]);
  unit_.resize(order_.size());
  diagonal_.resize(order_.size());
}

namespace {

// A block of the row being worked on, its columns padded.
template <int K>
auto columns(double* from) {
  return Eigen::Map<Eigen::Matrix<double, kWorkBlock<K> / K, K>>(from);
}

// The block, which is zero afterwards.
template <int K>
Eigen::Matrix<double, K, K> take_block(double* from) {
  const Eigen::Matrix<double, K, K> block = columns<K>(from).template topRows<K>();
  std::fill_n(from, kWorkBlock<K>, 0.0);
  return block;
}

// The elimination tree's paths from the entries of a row to its diagonal: what fills in.
class RowPattern {
 public:
  explicit RowPattern(std::size_t n) : mark_(n, -1), path_(n), pattern_(n), end_(n) {}

  void begin(Index k) {
    mark_[k] = k;
    top_ = end_;
  }
  void add(Index i, Index k, const std::vector<Index>& parent) {
    std::size_t length = 0;
    for (; mark_[i] != k; i = parent[i]) {
      path_[length++] = i;
      mark_[i] = k;
    }
    while (length > 0) pattern_[--top_] = path_[--length];
  }
  // The next column to be eliminated, -1 after the last.
  Index next() { return top_ < end_ ? pattern_[top_++] : -1; }

 private:
  std::vector<Index> mark_, path_, pattern_;
  std::size_t end_, top_ = 0;
};

}  // namespace

// Row by row: each row of L solves a triangular system whose pattern is read off the tree.
template <int K>
void BlockLdlt<K>::factorize(const SparseMatrix& A, const Poll& poll) {
  std::vector<Index> filled(start_.begin(), start_.end() - 1);
  RowPattern pattern(order_.size());
  constexpr int kSize = kWorkBlock<K>, kColumn = kSize / K;
  std::vector<double> work(kSize * order_.size(), 0.0);
  const auto at = [&](Index i) { return work.data() + kSize * static_cast<std::size_t>(i); };
  for (Index k = 0; k < n_; ++k) {
    if (poll && k % 256 == 0) poll();
    pattern.begin(k);
    const BlockRow<K> row(A, order_[k]);
    const Index width = K * row.size;
    for (Index e = 0; e < row.size; ++e) {
      const Index i = place_[row.column(e)];
      if (i > k) continue;
      for (int c = 0; c < K; ++c)
        for (int d = 0; d < K; ++d)
          at(i)[kColumn * d + c] = A.valuePtr()[row.first + c * width + K * e + d];
      pattern.add(i, k, parent_);
    }
    Block pivot = take_block<K>(at(k));
    for (Index i; (i = pattern.next()) >= 0;) {
      Block y = take_block<K>(at(i));  // becomes row block (k, i) of L D
      for (int c = 1; c < K; ++c)
        for (int d = 0; d < c; ++d) y.col(c) -= unit_[i](c, d) * y.col(d);
      if (const Index count = filled[i] - start_[i]; count > 0) {
        double padded[kSize] = {};
        columns<K>(padded).template topRows<K>() = y;
        const auto subtract = K == 2 ? subtract_updates_2 : subtract_updates_3;
        subtract(work.data(), padded, row_.data() + start_[i], lower_[start_[i]].data(), count);
      }
      const Block entry = y * diagonal_[i].cwiseInverse().asDiagonal();
      pivot.noalias() -= entry * y.transpose();
      row_[filled[i]] = k;
      lower_[filled[i]++] = entry;
    }
    factorize_pivot<K>(pivot, unit_[k], diagonal_[k]);
    if (!diagonal_[k].cwiseInverse().allFinite())
      throw Error("SolverError", "a pivot is zero or not finite", {order_[k]});
  }
}

template <int K>
Vec BlockLdlt<K>::solve(const VecRef& right) const {
  std::vector<Part> x(order_.size());
  for (Index k = 0; k < n_; ++k) x[k] = right.template segment<K>(K * order_[k]);
  for (Index k = 0; k < n_; ++k) {
    unit_[k].template triangularView<Eigen::UnitLower>().solveInPlace(x[k]);
    for (Index p = start_[k]; p < start_[k + 1]; ++p) x[row_[p]].noalias() -= lower_[p] * x[k];
  }
  for (Index k = n_ - 1; k >= 0; --k) {
    x[k].array() /= diagonal_[k].array();
    for (Index p = start_[k]; p < start_[k + 1]; ++p)
      x[k].noalias() -= lower_[p].transpose() * x[row_[p]];
    unit_[k].transpose().template triangularView<Eigen::UnitUpper>().solveInPlace(x[k]);
  }
  Vec solution(right.size());
  for (Index k = 0; k < n_; ++k) solution.segment<K>(K * order_[k]) = x[k];
  return solution;
}

template class BlockLdlt<2>;
template class BlockLdlt<3>;

}  // namespace stretchmap::linalg
