#include "linalg/multigrid/level_matrix.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

template <class T, int B>
using RowBlock = Eigen::Matrix<T, B, B, B == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
template <class T, int B>
using ColBlock = Eigen::Matrix<T, B, B>;

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
      n, chunk, [] { return std::vector<Entry>(); },
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
      });
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
    std::fill_n(entries->value.end() - kPadding, kPadding, 0.0f);
  }
  for_chunks(n, kRows, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for_sweep_entries(i, [&](SweepEntries& to, Index at, Index e) { to.col[at] = col[e]; });
  });
}

template <int B>
std::vector<Index> LevelMatrix<B>::set_values(const double* given, double factor) {
  constexpr size_t kSize = B * B;
  values = given;
  scale = factor;
  diagonal.resize(kSize * n);
  for_chunks(n, kRows, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      for (size_t k = 0; k < kSize; ++k)
        diagonal[kSize * i + k] = scale * values[kSize * diagonal_source[i] + k];
      for_sweep_entries(i, [&](SweepEntries& to, Index at, Index e) {
        const auto entry = block(e);
        for (int r = 0; r < B; ++r)
          for (int c = 0; c < B; ++c)
            to.value[kSize * at + B * c + r] = static_cast<float>(entry[B * r + c]);
      });
    }
  });
  std::vector<Index> bad = set_diagonals();
  set_excess();
  return bad;
}

template <int B>
std::vector<Index> LevelMatrix<B>::set_diagonals() {
  constexpr size_t kSize = B * B;
  inverse_f.resize(kSize * n + kPadding);
  std::fill_n(inverse_f.end() - kPadding, kPadding, 0.0f);
  std::vector<char> bad(n, 0);
  for_chunks(n, kRows, [&](Index begin, Index end) {
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

// Of the simultaneous sweeps M, M + M' - A has to be positive definite. It is the enlarged diagonal
// less the couplings to other chunks, and in units of the diagonal blocks a row outweighs these by
// their norms.
template <int B>
void LevelMatrix<B>::set_excess() {
  constexpr size_t kSize = B * B;
  excess.assign(n, 0.0f);
  std::vector<Index> place(n, -1), coupled;
  for (Index i = 0; i < n; ++i) {
    if (lower[i] == start[i]) continue;
    place[i] = static_cast<Index>(coupled.size());
    coupled.push_back(i);
  }
  std::vector<ColBlock<double, B>> root(coupled.size());
  for_chunks(static_cast<Index>(coupled.size()), kRows, [&](Index begin, Index end) {
    for (Index k = begin; k < end; ++k) {
      const Eigen::Map<const RowBlock<double, B>> block(diagonal.data() + kSize * coupled[k]);
      root[k] = ColBlock<double, B>(block).llt().matrixL();
    }
  });
  const auto relative = [&](Index i, Index e) {
    const auto entry = block(e);
    ColBlock<double, B> scaled = Eigen::Map<const RowBlock<double, B>>(entry.data());
    root[place[i]].template triangularView<Eigen::Lower>().solveInPlace(scaled);
    scaled.transposeInPlace();
    root[place[col[e]]].template triangularView<Eigen::Lower>().solveInPlace(scaled);
    return scaled.norm();
  };
  for_chunks(static_cast<Index>(coupled.size()), kRows, [&](Index begin, Index end) {
    for (Index k = begin; k < end; ++k) {
      const Index i = coupled[k];
      double coupling = 0.0;
      for (Index e = start[i]; e < lower[i]; ++e) coupling += relative(i, e);
      const double enlarge = std::max(1.0, 0.5 * (1.0 + coupling));
      excess[i] = static_cast<float>(1.0 - 1.0 / enlarge);
      for (size_t j = 0; j < kSize; ++j) inverse_f[kSize * i + j] /= static_cast<float>(enlarge);
    }
  });
}

template struct LevelMatrix<1>;
template struct LevelMatrix<3>;
template struct LevelMatrix<6>;

}  // namespace stretchmap::linalg
