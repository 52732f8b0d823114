#include "stretchmap/linalg/block_ldlt.hpp"

#include <algorithm>
#include <exception>

#include "linalg/direct/dense_front.hpp"
#include "linalg/direct/minimum_degree.hpp"
#include "linalg/direct/nested_dissection.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {

namespace {

constexpr Index kTrees = 32;    // subtrees at least that threads work on, if there are so many
constexpr Index kColumns = 16;  // block columns of a front that one thread fills
constexpr Index kRows = 128;    // rows of a front that one thread multiplies
// Flops from which on another order is worth a look, and of how many it saves it is taken: its
// trees are less even, and leave less for threads to share.
constexpr double kCheap = 1e6, kFewer = 0.8;

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

// The blocks' pattern.
template <int K>
struct BlockGraph {
  BlockGraph(const SparseMatrix& A, Index n) {
    for (Index i = 0; i < n; ++i) {
      const BlockRow<K> row(A, i);
      for (Index e = 0; e < row.size; ++e) col.push_back(row.column(e));
      start.push_back(static_cast<Index>(col.size()));
    }
  }
  std::vector<Index> start{0}, col;
};

}  // namespace

template <int K>
BlockLdlt<K>::BlockLdlt(const SparseMatrix& A) : n_(static_cast<Index>(A.rows()) / K) {
  const BlockGraph<K> graph(A, n_);
  const Index *start = graph.start.data(), *col = graph.col.data();
  plan(A, dissect(n_, start, col));
  if (const double dissected = flops(); dissected > kCheap) {
    MinimumDegree other = minimum_degree(n_, start, col, K);
    if (other.flops < kFewer * dissected) plan(A, std::move(other.tree));
  }
  group_fronts();
}

template <int K>
void BlockLdlt<K>::plan(const SparseMatrix& A, Dissection found) {
  fronts_.clear();
  total_ = 0;
  order_ = std::move(found.order);
  place_.resize(order_.size());
  for (Index k = 0; k < n_; ++k) place_[order_[k]] = k;
  for (Dissection::Node& node : found.nodes) {
    fronts_.emplace_back();
    fronts_.back().first = node.first;
    fronts_.back().last = node.last;
    fronts_.back().children = std::move(node.children);
  }
  find_borders(A);
}

template <int K>
void BlockLdlt<K>::find_borders(const SparseMatrix& A) {
  for (Front& front : fronts_) {
    std::vector<Index>& border = front.border;
    for (Index k = front.first; k < front.last; ++k) {
      const BlockRow<K> row(A, order_[k]);
      for (Index e = 0; e < row.size; ++e) border.push_back(place_[row.column(e)]);
    }
    for (const Index child : front.children)
      border.insert(border.end(), fronts_[child].border.begin(), fronts_[child].border.end());
    border.erase(std::remove_if(border.begin(), border.end(),
                                [&](Index place) { return place < front.last; }),
                 border.end());
    std::sort(border.begin(), border.end());
    border.erase(std::unique(border.begin(), border.end()), border.end());
    border.shrink_to_fit();
    front.start = total_;
    total_ += static_cast<std::size_t>(K * K) * front.size() * front.own();
  }
}

template <int K>
double BlockLdlt<K>::flops() const {
  double sum = 0.0;
  for (const Front& front : fronts_) sum += front_flops(K * front.size(), K * front.own());
  return sum;
}

// Subtrees of moderate size, each for one thread; the few large fronts above them are for all.
template <int K>
void BlockLdlt<K>::group_fronts() {
  std::vector<Index> least(fronts_.size());  // first front of the subtree
  for (Index f = 0; f < static_cast<Index>(fronts_.size()); ++f) {
    least[f] = f;
    for (const Index child : fronts_[f].children) least[f] = std::min(least[f], least[child]);
  }
  std::vector<Index> open{static_cast<Index>(fronts_.size()) - 1};
  for (std::size_t i = 0; i < open.size(); ++i) {
    const Index f = open[i];
    if ((f - least[f] + 1) * kTrees <= static_cast<Index>(fronts_.size())) {
      trees_.emplace_back(least[f], f + 1);
      for (Index g = least[f]; g <= f; ++g) {
        const std::vector<Index>& border = fronts_[g].border;
        const auto behind = std::lower_bound(border.begin(), border.end(), fronts_[f].last);
        fronts_[g].inside = static_cast<Index>(behind - border.begin());
      }
    } else {
      top_.push_back(f);
      open.insert(open.end(), fronts_[f].children.begin(), fronts_[f].children.end());
    }
  }
  std::sort(top_.begin(), top_.end());
}

template <int K>
void BlockLdlt<K>::eliminate(const SparseMatrix& A, Index f, std::vector<Leftover>& leftovers) {
  const Front& front = fronts_[f];
  const Index own = front.own(), size = front.size(), rest = size - own;
  const std::ptrdiff_t rows = K * size, lower = K * rest;
  double* panel = values_.get() + front.start;
  Leftover& leftover = leftovers[f];
  leftover.reset(new double[static_cast<std::size_t>(lower) * lower]);
  for_rows(size, kColumns, [&](Index j) {
    if (j < own)
      std::fill_n(panel + K * j * rows, K * rows, 0.0);
    else
      std::fill_n(leftover.get() + K * (j - own) * lower, K * lower, 0.0);
  });
  const auto row_of = [&](Index place) {
    return place < front.last
               ? place - front.first
               : own + static_cast<Index>(
                           std::lower_bound(front.border.begin(), front.border.end(), place) -
                           front.border.begin());
  };
  // Where block (i, j) of the front is, j <= i, and the distance of its columns.
  const auto at = [&](Index i, Index j) {
    return j < own ? std::pair(panel + K * j * rows + K * i, rows)
                   : std::pair(leftover.get() + K * (j - own) * lower + K * (i - own), lower);
  };
  for_rows(own, kColumns, [&](Index j) {
    const Index k = front.first + j;
    const BlockRow<K> row(A, order_[k]);
    for (Index e = 0; e < row.size; ++e) {
      const Index place = place_[row.column(e)];
      if (place < k) continue;
      const auto [to, stride] = at(row_of(place), j);
      for (int c = 0; c < K; ++c)
        for (int d = 0; d < K; ++d)
          to[c * stride + d] = A.valuePtr()[row.first + (c * row.size + e) * K + d];
    }
  });
  for (const Index child : front.children) {
    const std::vector<Index>& border = fronts_[child].border;
    const Index count = static_cast<Index>(border.size());
    std::vector<Index> to(border.size());
    std::transform(border.begin(), border.end(), to.begin(), row_of);
    const std::ptrdiff_t height = K * count;
    for_rows(count, kColumns, [&](Index j) {
      for (int c = 0; c < K; ++c) {
        const double* from = leftovers[child].get() + (K * j + c) * height;
        const auto [column, stride] = at(to[j], to[j]);
        for (Index i = j; i < count; ++i)
          for (int d = 0; d < K; ++d)
            column[c * stride + K * (to[i] - to[j]) + d] += from[K * i + d];
      }
    });
    leftovers[child].reset();
  }
  const Index bad = eliminate_front(panel, leftover.get(), K * size, K * own);
  if (bad >= 0)
    throw Error("SolverError", "a pivot is zero or not finite", {order_[front.first + bad / K]});
}

template <int K>
void BlockLdlt<K>::factorize(const SparseMatrix& A, const Poll& poll) {
  // Not set to zero here: the threads do that, each where it works.
  if (!values_) values_.reset(new double[total_]);
  std::vector<Leftover> leftovers(fronts_.size());
  std::vector<std::exception_ptr> failed(trees_.size());
  if (poll) poll();
  for_tasks(static_cast<Index>(trees_.size()), [&](Index t) {
    try {
      for (Index f = trees_[t].first; f < trees_[t].second; ++f) eliminate(A, f, leftovers);
    } catch (...) {
      failed[t] = std::current_exception();
    }
  });
  for (const std::exception_ptr& error : failed)
    if (error) std::rethrow_exception(error);
  for (const Index f : top_) {
    if (poll) poll();
    eliminate(A, f, leftovers);
  }
}

template <int K>
std::vector<Index> BlockLdlt<K>::not_positive() const {
  std::vector<Index> rows;
  for (const Front& front : fronts_) {
    const Panel panel(values_.get() + front.start, K * front.size(), K * front.own());
    for (Index k = 0; k < K * front.own() && rows.size() < 20; ++k)
      if (!(panel(k, k) > 0.0)) rows.push_back(K * order_[front.first + k / K] + k % K);
  }
  return rows;
}

// What a front takes from the unknowns behind it: rows of far, shared among threads.
template <int K>
Vec BlockLdlt<K>::forward(const Front& front, Vec& x) const {
  const Panel panel(values_.get() + front.start, K * front.size(), K * front.own());
  auto near = x.segment(K * front.first, K * front.own());
  panel.topRows(near.size()).template triangularView<Eigen::UnitLower>().solveInPlace(near);
  Vec far(panel.rows() - near.size());
  for_chunks(static_cast<Index>(far.size()), kRows, [&](Index begin, Index end) {
    far.segment(begin, end - begin).noalias() =
        panel.middleRows(near.size() + begin, end - begin) * near;
  });
  near.array() /= panel.diagonal().array();
  return far;
}

template <int K>
void BlockLdlt<K>::backward(const Front& front, Vec& x) const {
  const Panel panel(values_.get() + front.start, K * front.size(), K * front.own());
  auto near = x.segment(K * front.first, K * front.own());
  Vec far(panel.rows() - near.size());
  for (Index i = 0; i < static_cast<Index>(front.border.size()); ++i)
    far.template segment<K>(K * i) = x.template segment<K>(K * front.border[i]);
  for_chunks(static_cast<Index>(near.size()), kRows, [&](Index begin, Index end) {
    near.segment(begin, end - begin).noalias() -=
        panel.block(near.size(), begin, far.size(), end - begin).transpose() * far;
  });
  panel.topRows(near.size())
      .transpose()
      .template triangularView<Eigen::UnitUpper>()
      .solveInPlace(near);
}

template <int K>
Vec BlockLdlt<K>::solve(const VecRef& right) const {
  Vec x(right.size());
  for_rows(n_, [&](Index k) {
    x.template segment<K>(K * k) = right.template segment<K>(K * order_[k]);
  });
  const auto subtract = [&](const Front& front, const Vec& far, Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      x.template segment<K>(K * front.border[i]) -= far.template segment<K>(K * i);
  };
  // What a subtree's fronts take from unknowns behind it waits until it is their turn.
  std::vector<Vec> far(fronts_.size());
  for_tasks(static_cast<Index>(trees_.size()), [&](Index t) {
    for (Index f = trees_[t].first; f < trees_[t].second; ++f) {
      far[f] = forward(fronts_[f], x);
      subtract(fronts_[f], far[f], 0, fronts_[f].inside);
    }
  });
  auto top = top_.begin();
  for (Index f = 0; f < static_cast<Index>(fronts_.size()); ++f) {
    const Front& front = fronts_[f];
    if (top != top_.end() && *top == f) {
      far[f] = forward(front, x);
      ++top;
    }
    subtract(front, far[f], front.inside, static_cast<Index>(front.border.size()));
  }
  for (auto f = top_.rbegin(); f != top_.rend(); ++f) backward(fronts_[*f], x);
  for_tasks(static_cast<Index>(trees_.size()), [&](Index t) {
    for (Index f = trees_[t].second; f-- > trees_[t].first;) backward(fronts_[f], x);
  });
  Vec solution(right.size());
  for_rows(n_, [&](Index k) { solution.segment<K>(K * order_[k]) = x.template segment<K>(K * k); });
  return solution;
}

template class BlockLdlt<1>;
template class BlockLdlt<2>;
template class BlockLdlt<3>;

}  // namespace stretchmap::linalg
