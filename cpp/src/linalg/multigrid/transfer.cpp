#include "linalg/multigrid/transfer.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "linalg/multigrid/block_products.hpp"
#include "stretchmap/base/incidence.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

constexpr Index kParts = 10;  // of A P: all of it would be the largest array there is

// The transpose of a pattern and, for each of its entries, the entry it came from.
std::pair<Pattern, Buffer<Index>> transpose(const Pattern& p) {
  struct Entry {
    Index row, at;
  };
  const auto entries = listed_at<Entry>(p.columns, p.rows(), [&](Index i, const auto& visit) {
    for (Index e = p.start[i]; e < p.start[i + 1]; ++e) visit(p.col[e], Entry{i, e});
  });
  Pattern t;
  t.columns = p.rows();
  t.start.assign(static_cast<size_t>(p.columns) + 1, 0);
  t.col.resize(p.col.size());
  Buffer<Index> from(p.col.size());
  const Entry* const all = entries.of(0, p.columns).begin();
  for_chunks(p.columns, kChunk / 16, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) t.start[c + 1] = static_cast<Index>(entries[c].end() - all);
    for (const Entry& entry : entries.of(begin, end)) {
      t.col[&entry - all] = entry.row;
      from[&entry - all] = entry.at;
    }
  });
  return {std::move(t), std::move(from)};
}

// to += a b with row-major matrices, a (R x M) or, if Transposed, (M x R). What is added to is kept
// in registers: the compiler cannot know that the matrices do not overlap.
template <int R, int M, int C, bool Transposed, class A, class B>
void multiply_add(const A* a, const B* b, double* to) {
  double sum[R * C];
  for (int k = 0; k < R * C; ++k) sum[k] = to[k];
  for (int r = 0; r < R; ++r)
    for (int m = 0; m < M; ++m)
      for (int c = 0; c < C; ++c)
        sum[C * r + c] += a[Transposed ? R * m + r : M * r + m] * b[C * m + c];
  for (int k = 0; k < R * C; ++k) to[k] = sum[k];
}

// Gram-Schmidt, twice, on the modes restricted to each aggregate; a column that the others span
// becomes zero. Returns the modes of the aggregates.
template <int B, int K>
std::vector<double> make_orthonormal(Index n, const Aggregates& aggregates,
                                     std::vector<double>& tentative) {
  Pattern member_rows;
  member_rows.columns = aggregates.count;
  member_rows.start.assign(static_cast<size_t>(n) + 1, 0);
  for (Index i = 0; i < n; ++i) {
    if (aggregates.of[i] >= 0) member_rows.col.push_back(aggregates.of[i]);
    member_rows.start[i + 1] = static_cast<Index>(member_rows.col.size());
  }
  const Pattern members = transpose(member_rows).first;
  std::vector<double> coarse_modes(static_cast<size_t>(K) * K * aggregates.count, 0.0);
  for_chunks(aggregates.count, kCostlyChunk, [&](Index begin, Index end) {
    for (Index a = begin; a < end; ++a) {
      const auto dot = [&](int c, int d) {
        double sum = 0.0;
        for (Index e = members.start[a]; e < members.start[a + 1]; ++e) {
          const double* rows = tentative.data() + static_cast<size_t>(B) * K * members.col[e];
          for (int b = 0; b < B; ++b) sum += rows[K * b + c] * rows[K * b + d];
        }
        return sum;
      };
      const auto combine = [&](int c, double keep, int d, double factor) {
        for (Index e = members.start[a]; e < members.start[a + 1]; ++e) {
          double* rows = tentative.data() + static_cast<size_t>(B) * K * members.col[e];
          for (int b = 0; b < B; ++b)
            rows[K * b + c] = keep * rows[K * b + c] + factor * rows[K * b + d];
        }
      };
      double* R = coarse_modes.data() + static_cast<size_t>(K) * K * a;
      for (int c = 0; c < K; ++c) {
        const double before = std::sqrt(dot(c, c));
        for (int pass = 0; pass < 2; ++pass)
          for (int d = 0; d < c; ++d) {
            const double share = dot(c, d);
            R[K * d + c] += share;
            combine(c, 1.0, d, -share);
          }
        const double norm = std::sqrt(dot(c, c));
        const bool independent = norm > 1e-6 * before;
        R[K * c + c] = independent ? norm : 0.0;
        combine(c, independent ? 1.0 / norm : 0.0, c, 0.0);
      }
    }
  });
  return coarse_modes;
}

// to = scale * inverse * sum, a B x K block; `inverse` is column-major.
template <int B, int K>
void scaled_product(const float* inverse, const double* sum, double scale, float* to) {
  for (int b = 0; b < B; ++b)
    for (int k = 0; k < K; ++k) {
      double value = 0.0;
      for (int c = 0; c < B; ++c) value += inverse[B * c + b] * sum[K * c + k];
      to[K * b + k] = static_cast<float>(scale * value);
    }
}

}  // namespace

template <int B, int K>
std::vector<double> Transfer<B, K>::setup(const LevelMatrix<B>& A, const std::vector<double>& modes,
                                          double threshold, double damping) {
  const Aggregates aggregates = aggregate(A, threshold);
  std::vector<double> tentative = modes;
  std::vector<double> coarse_modes = make_orthonormal<B, K>(A.n, aggregates, tentative);
  const Buffer<Index> r_entry = set_patterns(A, aggregates);
  set_prolongation(A, aggregates, tentative, damping);
  constexpr size_t kSize = static_cast<size_t>(B) * K;
  r_value.resize(p_value.size());
  r_value.back() = 0.0f;
  for_chunks(r.rows(), kChunk / 16, [&](Index begin, Index end) {
    for (size_t e = r.start[begin]; e < static_cast<size_t>(r.start[end]); ++e)
      for (size_t k = 0; k < kSize; ++k) r_value[kSize * e + k] = p_value[kSize * r_entry[e] + k];
  });
  return coarse_modes;
}

template <int B, int K>
Buffer<Index> Transfer<B, K>::set_patterns(const LevelMatrix<B>& A, const Aggregates& aggregates) {
  const std::vector<Index>& of = aggregates.of;
  p = build_pattern(A.n, aggregates.count, [&](Index i, RowSet& row) {
    if (of[i] >= 0) row.add(of[i]);
    for (Index e = A.start[i]; e < A.start[i + 1]; ++e)
      if (aggregates.strong[e] && of[A.col[e]] >= 0) row.add(of[A.col[e]]);
  });
  const auto add_row = [](const Pattern& pattern, Index i, RowSet& row) {
    for (Index e = pattern.start[i]; e < pattern.start[i + 1]; ++e) row.add(pattern.col[e]);
  };
  Buffer<Index> r_entry;
  std::tie(r, r_entry) = transpose(p);
  ap = build_pattern(A.n, aggregates.count, [&](Index i, RowSet& row) {
    add_row(p, i, row);
    for (Index e = A.start[i]; e < A.start[i + 1]; ++e) add_row(p, A.col[e], row);
  });
  coarse = build_pattern(aggregates.count, aggregates.count, [&](Index a, RowSet& row) {
    row.add(a);
    for (Index e = r.start[a]; e < r.start[a + 1]; ++e) add_row(ap, r.col[e], row);
  });
  return r_entry;
}

template <int B, int K>
void Transfer<B, K>::set_prolongation(const LevelMatrix<B>& A, const Aggregates& aggregates,
                                      const std::vector<double>& tentative, double damping) {
  constexpr size_t kSize = static_cast<size_t>(B) * K;
  const std::vector<Index>& of = aggregates.of;
  p_value.resize(kSize * p.col.size() + 1);  // see add_block_products
  p_value.back() = 0.0f;
  const auto rows = [&](Index begin, Index end, std::vector<Index>& slot) {
    std::vector<double> sum;
    for (Index i = begin; i < end; ++i) {
      const Index first = p.start[i], length = p.start[i + 1] - first;
      if (length == 0) continue;
      for (Index s = 0; s < length; ++s) slot[p.col[first + s]] = s;
      sum.assign(kSize * length, 0.0);
      // sum = A T, B x K per slot, without the diagonal
      double lumped = 0.0;
      for (Index e = A.start[i]; e < A.start[i + 1]; ++e) {
        const Index j = A.col[e];
        if (!aggregates.strong[e]) {
          if constexpr (B == 1) lumped += A.block(e)[0];
          continue;
        }
        if (of[j] < 0) continue;
        multiply_add<B, B, K, false>(A.block(e).data(), tentative.data() + kSize * j,
                                     sum.data() + kSize * slot[of[j]]);
      }
      // P = T - damping (T + D^-1 sum)
      const float* inverse = A.inverse_f.data() + static_cast<size_t>(B * B) * i;
      double scale = -damping / (1.0 - A.excess[i]);
      if constexpr (B == 1) {
        const double d = A.diagonal[i];
        scale = -damping * d / std::max(d + lumped, 0.1 * d) / (1.0 - A.excess[i]);
      }
      for (Index s = 0; s < length; ++s)
        scaled_product<B, K>(inverse, &sum[kSize * s], scale, &p_value[kSize * (first + s)]);
      if (of[i] >= 0) {
        float* out = p_value.data() + kSize * (first + slot[of[i]]);
        for (size_t k = 0; k < kSize; ++k)
          out[k] += static_cast<float>((1.0 - damping) * tentative[kSize * i + k]);
      }
    }
  };
  for_chunks_with(
      A.n, LevelMatrix<B>::kRows, [&] { return std::vector<Index>(aggregates.count); }, rows);
}

// to[f] += a p[j, f] for the entries f of row j of P.
template <int B, int K>
void add_row(const double* a, const Transfer<B, K>& t, Index j, const Index* slot, double* to) {
  const size_t first = t.p.start[j], last = t.p.start[j + 1];
  const float* row = t.p_value.data() + static_cast<size_t>(B * K) * first;
  if constexpr (B == 3 && K == 3) {
    add_block_products(a, row, t.p.col.data() + first, static_cast<Index>(last - first), slot, to);
  } else {
    for (size_t e = first; e < last; ++e, row += B * K)
      multiply_add<B, B, K, false>(a, row, to + static_cast<size_t>(B * K) * slot[t.p.col[e]]);
  }
}

// Rows [first, last) of A P.
template <int B, int K>
void Transfer<B, K>::multiply_rows(const LevelMatrix<B>& A, Index first, Index last,
                                   double* product) const {
  constexpr size_t kSize = static_cast<size_t>(B) * K;
  const auto at = [&](Index i) { return kSize * (ap.start[i] - ap.start[first]); };
  for_chunks_with(
      last - first, kChunk / 8, [&] { return std::vector<Index>(coarse.rows()); },
      [&](Index begin, Index end, std::vector<Index>& slot) {
        std::fill(product + at(first + begin), product + at(first + end), 0.0);
        for (Index i = first + begin; i < first + end; ++i) {
          for (Index e = ap.start[i]; e < ap.start[i + 1]; ++e)
            slot[ap.col[e]] = e - ap.start[first];
          add_row(A.diagonal.data() + static_cast<size_t>(B * B) * i, *this, i, slot.data(),
                  product);
          for (Index e = A.start[i]; e < A.start[i + 1]; ++e)
            add_row(A.block(e).data(), *this, A.col[e], slot.data(), product);
        }
      });
}

template <int B, int K>
Buffer<double> Transfer<B, K>::coarse_values(const LevelMatrix<B>& A) const {
  constexpr size_t kSize = static_cast<size_t>(B) * K, kCoarse = static_cast<size_t>(K) * K;
  Buffer<double> values(kCoarse * coarse.col.size());
  for_chunks(coarse.rows(), kChunk / 16, [&](Index begin, Index end) {
    std::fill(values.begin() + kCoarse * coarse.start[begin],
              values.begin() + kCoarse * coarse.start[end], 0.0);
  });
  std::vector<Index> next(r.start.begin(), r.start.end() - 1);  // first entry of r not yet added
  const Index at_once = std::max(kChunk, A.n / kParts + 1);
  Index most = 0;
  for (Index first = 0; first < A.n; first += at_once)
    most = std::max(most, ap.start[std::min(A.n, first + at_once)] - ap.start[first]);
  // Filled by the threads that need it; one more number, see add_block_products.
  const std::unique_ptr<double[]> product(new double[kSize * most + 1]);
  for (Index first = 0; first < A.n; first += at_once) {
    const Index last = std::min(A.n, first + at_once);
    multiply_rows(A, first, last, product.get());
    for_chunks_with(
        coarse.rows(), kChunk / 16, [&] { return std::vector<Index>(coarse.rows()); },
        [&](Index begin, Index end, std::vector<Index>& slot) {
          for (Index a = begin; a < end; ++a) {
            Index& e = next[a];
            const auto there = [&] { return e < r.start[a + 1] && r.col[e] < last; };
            if (!there()) continue;
            for (Index c = coarse.start[a]; c < coarse.start[a + 1]; ++c) slot[coarse.col[c]] = c;
            for (; there(); ++e) {
              const Index i = r.col[e];
              const float* left = r_value.data() + kSize * e;
              const double* right = product.get() + kSize * (ap.start[i] - ap.start[first]);
              if constexpr (B == 3 && K == 3) {
                double transposed[9];
                for (int k = 0; k < 9; ++k) transposed[k] = left[3 * (k % 3) + k / 3];
                add_block_products(transposed, right, ap.col.data() + ap.start[i],
                                   ap.start[i + 1] - ap.start[i], slot.data(), values.data());
                continue;
              }
              for (Index f = ap.start[i]; f < ap.start[i + 1]; ++f, right += kSize)
                multiply_add<K, B, K, true>(left, right, values.data() + kCoarse * slot[ap.col[f]]);
            }
          }
        });
  }
  keep_regular(values);
  return values;
}

// A mode that an aggregate cannot represent: an equation of its own keeps the matrix regular.
template <int B, int K>
void Transfer<B, K>::keep_regular(Buffer<double>& values) const {
  for (Index a = 0; K > 1 && a < coarse.rows(); ++a) {
    const Index* columns = coarse.col.data();
    const Index at = static_cast<Index>(
        std::lower_bound(columns + coarse.start[a], columns + coarse.start[a + 1], a) - columns);
    double* block = values.data() + static_cast<size_t>(K * K) * at;
    double largest = 0.0;
    for (int k = 0; k < K; ++k) largest = std::max(largest, block[(K + 1) * k]);
    for (int k = 0; k < K; ++k)
      if (block[(K + 1) * k] == 0.0) block[(K + 1) * k] = largest > 0.0 ? largest : 1.0;
  }
}

// Several columns (N > 1) come with single unknowns only.
template <int B, int K>
template <int N>
void Transfer<B, K>::restrict_to(const float* r_fine, float* b) const {
  static_assert(N == 1 || (B == 1 && K == 1));
  for_chunks(r.rows(), kChunk / 16, [&](Index begin, Index end) {
    for (Index a = begin; a < end; ++a) {
      if constexpr (N > 1) {
        Lanes<float, N> total = Lanes<float, N>::Zero();
        for (Index e = r.start[a]; e < r.start[a + 1]; ++e)
          total += r_value[e] * lanes<N>(r_fine + static_cast<size_t>(N) * r.col[e]);
        Eigen::Map<Lanes<float, N>>(b + static_cast<size_t>(N) * a) = total;
        continue;
      }
      float sum[K * N] = {};
      for (Index e = r.start[a]; e < r.start[a + 1]; ++e) {
        const float* block = r_value.data() + static_cast<size_t>(B * K) * e;
        const float* from = r_fine + static_cast<size_t>(B * N) * r.col[e];
        for (int row = 0; row < B; ++row)
          for (int k = 0; k < K; ++k)
            for (int j = 0; j < N; ++j) sum[N * k + j] += block[K * row + k] * from[N * row + j];
      }
      for (int k = 0; k < K * N; ++k) b[static_cast<size_t>(K * N) * a + k] = sum[k];
    }
  });
}

template <int B, int K>
template <int N>
void Transfer<B, K>::prolong_add(const float* c, const float* x, float* y) const {
  static_assert(N == 1 || (B == 1 && K == 1));
  for_chunks(p.rows(), kChunk / (B * K), [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      if constexpr (N > 1) {
        Lanes<float, N> total = lanes<N>(x + static_cast<size_t>(N) * i);
        for (Index e = p.start[i]; e < p.start[i + 1]; ++e)
          total += p_value[e] * lanes<N>(c + static_cast<size_t>(N) * p.col[e]);
        Eigen::Map<Lanes<float, N>>(y + static_cast<size_t>(N) * i) = total;
        continue;
      }
      float sum[B * N];
      for (int k = 0; k < B * N; ++k) sum[k] = x[static_cast<size_t>(B * N) * i + k];
      for (Index e = p.start[i]; e < p.start[i + 1]; ++e) {
        const float* block = p_value.data() + static_cast<size_t>(B * K) * e;
        const float* from = c + static_cast<size_t>(K * N) * p.col[e];
        for (int row = 0; row < B; ++row)
          for (int k = 0; k < K; ++k)
            for (int j = 0; j < N; ++j) sum[N * row + j] += block[K * row + k] * from[N * k + j];
      }
      for (int k = 0; k < B * N; ++k) y[static_cast<size_t>(B * N) * i + k] = sum[k];
    }
  });
}

template struct Transfer<1, 1>;
template void Transfer<1, 1>::restrict_to<1>(const float*, float*) const;
template void Transfer<1, 1>::restrict_to<2>(const float*, float*) const;
template void Transfer<1, 1>::restrict_to<4>(const float*, float*) const;
template void Transfer<1, 1>::prolong_add<1>(const float*, const float*, float*) const;
template void Transfer<1, 1>::prolong_add<2>(const float*, const float*, float*) const;
template void Transfer<1, 1>::prolong_add<4>(const float*, const float*, float*) const;
template struct Transfer<3, 3>;
template void Transfer<3, 3>::restrict_to<1>(const float*, float*) const;
template void Transfer<3, 3>::prolong_add<1>(const float*, const float*, float*) const;
template struct Transfer<3, 6>;
template void Transfer<3, 6>::restrict_to<1>(const float*, float*) const;
template void Transfer<3, 6>::prolong_add<1>(const float*, const float*, float*) const;
template struct Transfer<6, 6>;
template void Transfer<6, 6>::restrict_to<1>(const float*, float*) const;
template void Transfer<6, 6>::prolong_add<1>(const float*, const float*, float*) const;

}  // namespace stretchmap::linalg
