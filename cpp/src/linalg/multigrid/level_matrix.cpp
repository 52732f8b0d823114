#include "linalg/multigrid/level_matrix.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

template <class T, int B>
using RowBlock = Eigen::Matrix<T, B, B, B == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
template <class T, int B>
using ColBlock = Eigen::Matrix<T, B, B>;

// A block row times x, pairs of numbers at a time, in several sums so that no addition waits for
// the one before. Blocks are row-major.
template <int B>
class BlockRowSum {
  static_assert(B % 2 == 0);
  using Pair = Lanes<double, 2>;

 public:
  BlockRowSum() {
    for (Pair& sum : row_) sum.setZero();
  }
  void add(const double* block, const double* x) {
    for (int c = 0; c < B; c += 2)
      for (int r = 0; r < B; ++r) row_[r] += lanes<2>(block + B * r + c) * lanes<2>(x + c);
  }
  void store(double* y) const {
    for (int r = 0; r < B; ++r) y[r] = row_[r].sum();
  }

 private:
  Pair row_[B];
};

template <>
class BlockRowSum<1> {
 public:
  void add(const double* block, const double* x) { sum_ += block[0] * x[0]; }
  void store(double* y) const { y[0] = sum_; }

 private:
  double sum_ = 0.0;
};

// Pairs of the nine numbers in a row, whether they belong to one row or two.
template <>
class BlockRowSum<3> {
  using Pair = Lanes<double, 2>;

 public:
  BlockRowSum() {
    for (Pair& sum : pair_) sum.setZero();
  }
  void add(const double* block, const double* x) {
    pair_[0] += lanes<2>(block) * lanes<2>(x);
    pair_[1] += lanes<2>(block + 2) * Pair(x[2], x[0]);
    pair_[2] += lanes<2>(block + 4) * lanes<2>(x + 1);
    pair_[3] += lanes<2>(block + 6) * lanes<2>(x);
    last_ += block[8] * x[2];
  }
  void store(double* y) const {
    y[0] = pair_[0].sum() + pair_[1][0];
    y[1] = pair_[1][1] + pair_[2].sum();
    y[2] = pair_[3].sum() + last_;
  }

 private:
  Pair pair_[4];
  double last_ = 0.0;
};

// Whether the block is positive definite; its inverse if so. Only the finest level has many rows,
// whose blocks are small.
template <int B>
bool invert(const ColBlock<double, B>& block, ColBlock<double, B>& inverse) {
  if constexpr (B > 3) {
    return invert_positive(block, inverse);
  } else {
    if (!is_positive_definite(block)) return false;
    inverse = block.inverse();
    return true;
  }
}

}  // namespace

template <int B>
void LevelMatrix<B>::set_pattern(Index rows, const Index* row_start, const Index* columns,
                                 const std::vector<Index>& order) {
  n = rows;
  chunk = std::max<Index>(kChunk / B, (n + 15) / 16);
  std::vector<Index> renumber(order.size());
  for (size_t i = 0; i < order.size(); ++i) renumber[order[i]] = static_cast<Index>(i);
  const auto old_row = [&](Index i) { return order.empty() ? i : order[i]; };
  start.assign(static_cast<size_t>(n) + 1, 0);
  for (Index i = 0; i < n; ++i)
    start[i + 1] = start[i] + row_start[old_row(i) + 1] - row_start[old_row(i)] - 1;
  lower.resize(n);
  upper.resize(n);
  diagonal_source.resize(n);
  col.resize(static_cast<size_t>(start[n]));
  source.resize(col.size());
  struct Entry {
    int group;
    Index column, from;
  };
  for_chunks_with(
      n, [] { return std::vector<Entry>(); },
      [&](Index begin, Index end, std::vector<Entry>& entries) {
        const Index first = begin, last = end;
        for (Index i = begin; i < end; ++i) {
          entries.clear();
          for (Index e = row_start[old_row(i)]; e < row_start[old_row(i) + 1]; ++e) {
            const Index j = order.empty() ? columns[e] : renumber[columns[e]];
            if (j == i)
              diagonal_source[i] = e;
            else
              entries.push_back({j < first || j >= last ? 0 : j < i ? 1 : 2, j, e});
          }
          std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
            return a.group != b.group ? a.group < b.group : a.column < b.column;
          });
          Index at = start[i];
          lower[i] = upper[i] = at;
          for (const Entry& entry : entries) {
            col[at] = entry.column;
            source[at++] = entry.from;
            if (entry.group < 1) lower[i] = at;
            if (entry.group < 2) upper[i] = at;
          }
        }
      },
      chunk);
  set_sweep_pattern();
}

template <int B>
void LevelMatrix<B>::set_sweep_pattern() {
  later.resize(n);
  for (SweepEntries* entries : {&earlier, &rest})
    entries->start.assign(static_cast<size_t>(n) + 1, 0);
  for (Index i = 0; i < n; ++i) {
    earlier.start[i + 1] = earlier.start[i] + upper[i] - lower[i];
    later[i] = rest.start[i] + lower[i] - start[i];
    rest.start[i + 1] = later[i] + start[i + 1] - upper[i];
  }
  for (SweepEntries* entries : {&earlier, &rest}) {
    const auto count = static_cast<size_t>(entries->start[n]);
    entries->col.resize(count);
    entries->value.resize(static_cast<size_t>(B * B) * count + kPadding);
  }
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for_sweep_entries(i, [&](SweepEntries& to, Index at, Index e) { to.col[at] = col[e]; });
  });
}

template <int B>
void LevelMatrix<B>::set_product_values(const double* values, double scale) {
  constexpr size_t kSize = B * B;
  value.resize(kSize * col.size());
  diagonal.resize(kSize * n);
  const auto copy = [&](Index from, double* to) {
    for (size_t k = 0; k < kSize; ++k) to[k] = scale * values[kSize * from + k];
  };
  for_chunks(n, [&](Index begin, Index end) {
    for (size_t e = start[begin]; e < static_cast<size_t>(start[end]); ++e)
      copy(source[e], value.data() + kSize * e);
    for (size_t i = begin; i < static_cast<size_t>(end); ++i)
      copy(diagonal_source[i], diagonal.data() + kSize * i);
  });
}

template <int B>
std::vector<Index> LevelMatrix<B>::set_values(const double* values, double scale) {
  constexpr size_t kSize = B * B;
  set_product_values(values, scale);
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for_sweep_entries(i, [&](SweepEntries& to, Index at, Index e) {
        for (int r = 0; r < B; ++r)
          for (int c = 0; c < B; ++c)
            to.value[kSize * at + B * c + r] = static_cast<float>(value[kSize * e + B * r + c]);
      });
  });
  std::vector<Index> bad = set_diagonals();
  set_excess();
  return bad;
}

template <int B>
std::vector<Index> LevelMatrix<B>::set_diagonals() {
  constexpr size_t kSize = B * B;
  inverse_f.resize(kSize * n + kPadding);
  std::vector<char> bad(n, 0);
  for_chunks(n, [&](Index begin, Index end) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i) {
      Eigen::Map<RowBlock<double, B>> block(diagonal.data() + kSize * i);
      ColBlock<double, B> inverse = ColBlock<double, B>::Zero();
      bad[i] = !block.allFinite() || !invert(ColBlock<double, B>(block), inverse);
      if (bad[i]) {
        block = map_eigenvalues(block, [](double eigenvalue, double largest) {
          return std::max({std::abs(eigenvalue), 1e-6 * largest, 1e-30});
        });
        invert(ColBlock<double, B>(block), inverse);
      }
      Eigen::Map<ColBlock<float, B>>(inverse_f.data() + kSize * i) = inverse.template cast<float>();
    }
  });
  std::vector<Index> rows;
  for (Index i = 0; i < n && rows.size() < 20; ++i)
    if (bad[i]) rows.push_back(i);
  return rows;
}

template <int B>
void LevelMatrix<B>::set_excess() {
  constexpr size_t kSize = B * B;
  excess.assign(n, 0.0f);
  const auto size_of = [&](Index i) {
    return Eigen::Map<const RowBlock<double, B>>(diagonal.data() + kSize * i).trace() / B;
  };
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      if (lower[i] == start[i]) continue;
      double coupling = 0.0;
      for (Index e = start[i]; e < lower[i]; ++e)
        coupling += Eigen::Map<const RowBlock<double, B>>(value.data() + kSize * e).norm() /
                    std::sqrt(size_of(i) * size_of(col[e]));
      const double enlarge = std::max(1.0, 0.5 * (1.0 + coupling));
      excess[i] = static_cast<float>(1.0 - 1.0 / enlarge);
      for (size_t k = 0; k < kSize; ++k) inverse_f[kSize * i + k] /= static_cast<float>(enlarge);
    }
  });
}

template <int B>
template <int K>
std::array<double, K> LevelMatrix<B>::multiply(const double* x, double* y) const {
  static_assert(B == 1 || K == 1);
  constexpr size_t kBlock = B * B;
  return sum_chunks<K>(n, [&](Index begin, Index end, std::array<double, K>& dots) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i) {
      if constexpr (K > 1) {
        Lanes<double, K> total = diagonal[i] * lanes<K>(x + K * i);
        for (size_t e = start[i]; e < static_cast<size_t>(start[i + 1]); ++e)
          total += value[e] * lanes<K>(x + K * col[e]);
        Eigen::Map<Lanes<double, K>>(y + K * i) = total;
        total *= lanes<K>(x + K * i);
        for (int k = 0; k < K; ++k) dots[k] += total[k];
        continue;
      }
      BlockRowSum<B> sum;
      sum.add(diagonal.data() + kBlock * i, x + B * i);
      for (size_t e = start[i]; e < static_cast<size_t>(start[i + 1]); ++e)
        sum.add(value.data() + kBlock * e, x + B * static_cast<size_t>(col[e]));
      sum.store(y + B * i);
      for (int r = 0; r < B; ++r) dots[0] += x[B * i + r] * y[B * i + r];
    }
  });
}

template struct LevelMatrix<1>;
template std::array<double, 1> LevelMatrix<1>::multiply<1>(const double*, double*) const;
template std::array<double, 2> LevelMatrix<1>::multiply<2>(const double*, double*) const;
template std::array<double, 4> LevelMatrix<1>::multiply<4>(const double*, double*) const;
template struct LevelMatrix<3>;
template std::array<double, 1> LevelMatrix<3>::multiply<1>(const double*, double*) const;
template struct LevelMatrix<6>;
template std::array<double, 1> LevelMatrix<6>::multiply<1>(const double*, double*) const;

}  // namespace stretchmap::linalg
