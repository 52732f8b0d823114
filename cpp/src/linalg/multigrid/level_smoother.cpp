// The single-precision part of a level matrix.
#include <Eigen/Core>
#include <algorithm>

#include "linalg/multigrid/level_matrix.hpp"
#include "stretchmap/base/clones.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

// The numbers of one row, held in whole vector registers: either one block row (K = 1, lanes are
// its B unknowns and padding) or K right-hand sides of one unknown (B = 1). Each column of a block
// has a sum of its own, so that no addition waits for the one before.
template <int B, int K>
class RowSum {
  static_assert(B == 1 || K == 1);
  static constexpr int kUsed = B * K;
  static constexpr int kLanes = kUsed <= 2 ? kUsed : (kUsed + 3) / 4 * 4;

 public:
  using Lanes = Eigen::Array<float, kLanes, 1>;
  STRETCHMAP_INLINE RowSum() {
    for (Lanes& sum : part_) sum.setZero();
  }
  STRETCHMAP_INLINE explicit RowSum(const float* from) : RowSum() {
    for (int k = 0; k < kUsed; ++k) part_[0][k] = from[k];
  }
  // this -= block * x; reads up to kPadding numbers beyond a column-major block.
  STRETCHMAP_INLINE void subtract(const float* block, const float* x) {
    if constexpr (B == 1)
      part_[0] -= block[0] * lanes(x);
    else
      for (int c = 0; c < B; ++c) part_[c] -= x[c] * lanes(block + B * c);
  }
  STRETCHMAP_INLINE Lanes total() const {
    Lanes sum = part_[0];
    for (int c = 1; c < B; ++c) sum += part_[c];
    return sum;
  }
  // block * sum
  STRETCHMAP_INLINE static Lanes transform(const float* block, const Lanes& sum) {
    if constexpr (B == 1) return block[0] * sum;
    Lanes out = sum[0] * lanes(block);
    for (int c = 1; c < B; ++c) out += sum[c] * lanes(block + B * c);
    return out;
  }
  STRETCHMAP_INLINE static void store(const Lanes& sum, float* to) {
    for (int k = 0; k < kUsed; ++k) to[k] = sum[k];
  }

 private:
  STRETCHMAP_INLINE static Eigen::Map<const Lanes> lanes(const float* from) {
    return Eigen::Map<const Lanes>(from);
  }
  Lanes part_[B];
};

// row -= entries [first, last) * x
template <int B, int K>
STRETCHMAP_INLINE void subtract(const SweepEntries& from, Index first, Index last, const float* x,
                                RowSum<B, K>& row) {
  const float* value = from.value.data() + static_cast<size_t>(B * B) * first;
  for (const Index *j = from.col.data() + first, *end = from.col.data() + last; j != end;
       ++j, value += B * B)
    row.subtract(value, x + static_cast<size_t>(B * K) * *j);
}

// Rows [begin, end) of the forward sweep.
template <int B, int K>
STRETCHMAP_INLINE void solve_earlier(const LevelMatrix<B>& A, Index begin, Index end,
                                     const float* b, float* x) {
  constexpr size_t kBlock = B * B, kRow = B * K;
  for (Index i = begin; i < end; ++i) {
    RowSum<B, K> row(b + kRow * i);
    subtract<B, K>(A.earlier, A.earlier.start[i], A.earlier.start[i + 1], x, row);
    row.store(row.transform(A.inverse_f.data() + kBlock * i, row.total()), x + kRow * i);
  }
}

// The sweep solved the earlier columns and the diagonal exactly; the rest is the residual.
template <int B, int K>
STRETCHMAP_INLINE void leave_rest(const LevelMatrix<B>& A, Index begin, Index end, const float* b,
                                  const float* x, float* r) {
  constexpr size_t kRow = B * K;
  for (Index i = begin; i < end; ++i) {
    RowSum<B, K> row;
    subtract<B, K>(A.rest, A.rest.start[i], A.rest.start[i + 1], x, row);
    auto total = row.total();
    if (A.excess[i] > 0.0f) {
      RowSum<B, K> enlarged(b + kRow * i);
      subtract<B, K>(A.earlier, A.earlier.start[i], A.earlier.start[i + 1], x, enlarged);
      total += A.excess[i] * enlarged.total();
    }
    row.store(total, r + kRow * i);
  }
}

// Rows [begin, end) of the backward sweep: backwards through memory, too; the nearest row, whose
// result was written last, at the end of what waits for such.
template <int B, int K>
STRETCHMAP_INLINE void solve_later(const LevelMatrix<B>& A, Index begin, Index end, const float* b,
                                   const float* y, float* x) {
  constexpr size_t kBlock = B * B, kRow = B * K;
  const SweepEntries &earlier = A.earlier, &rest = A.rest;
  for (Index i = end - 1; i >= begin; --i) {
    RowSum<B, K> known(b + kRow * i), next;
    for (Index e = rest.start[i + 1] - 1; e >= A.later[i]; --e)
      next.subtract(rest.value.data() + kBlock * e, x + kRow * rest.col[e]);
    for (Index e = A.later[i] - 1; e >= rest.start[i]; --e)
      known.subtract(rest.value.data() + kBlock * e, y + kRow * rest.col[e]);
    for (Index e = earlier.start[i + 1] - 1; e >= earlier.start[i]; --e)
      known.subtract(earlier.value.data() + kBlock * e, y + kRow * earlier.col[e]);
    auto moved = known.transform(A.inverse_f.data() + kBlock * i, known.total() + next.total());
    moved += A.excess[i] * RowSum<B, K>(y + kRow * i).total();
    known.store(moved, x + kRow * i);
  }
}

// A row of the backward sweep balanced its equation but for the columns before it and in other
// chunks, which moved since or at the same time, and for the part its diagonal is enlarged by.
template <int B>
STRETCHMAP_INLINE void leave_unbalanced(const LevelMatrix<B>& A, Index begin, Index end,
                                        const float* step, float* change) {
  constexpr size_t kBlock = B * B;
  for (Index i = begin; i < end; ++i) {
    RowSum<B, 1> row;
    subtract<B, 1>(A.earlier, A.earlier.start[i], A.earlier.start[i + 1], step, row);
    subtract<B, 1>(A.rest, A.rest.start[i], A.later[i], step, row);
    float* to = change + static_cast<size_t>(B) * i;
    row.store(-row.total(), to);
    if (A.excess[i] == 0.0f) continue;
    const float share = A.excess[i] / (1.0f - A.excess[i]);
    const float* mine = step + static_cast<size_t>(B) * i;
    for (int r = 0; r < B; ++r)
      for (int c = 0; c < B; ++c)
        to[r] -= share * static_cast<float>(A.diagonal[kBlock * i + B * r + c]) * mine[c];
  }
}

// Blocks of three unknowns, which is where the time goes, for several generations of processors.
STRETCHMAP_CLONES
void solve_earlier_3(const LevelMatrix<3>& A, Index begin, Index end, const float* b, float* x) {
  solve_earlier<3, 1>(A, begin, end, b, x);
}

STRETCHMAP_CLONES
void leave_rest_3(const LevelMatrix<3>& A, Index begin, Index end, const float* b, const float* x,
                  float* r) {
  leave_rest<3, 1>(A, begin, end, b, x, r);
}

STRETCHMAP_CLONES
void solve_later_3(const LevelMatrix<3>& A, Index begin, Index end, const float* b, const float* y,
                   float* x) {
  solve_later<3, 1>(A, begin, end, b, y, x);
}

STRETCHMAP_CLONES
void leave_unbalanced_3(const LevelMatrix<3>& A, Index begin, Index end, const float* step,
                        float* change) {
  leave_unbalanced<3>(A, begin, end, step, change);
}

}  // namespace

template <int B>
template <int K>
void LevelMatrix<B>::divide_by_diagonal(const float* r, float* z) const {
  constexpr size_t kBlock = B * B, kRow = B * K;
  for_chunks(n, kRows, [&](Index begin, Index end) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i) {
      const RowSum<B, K> row(r + kRow * i);
      row.store(row.transform(inverse_f.data() + kBlock * i, row.total()), z + kRow * i);
    }
  });
}

template <int B>
template <int K>
void LevelMatrix<B>::sweep_forward(const float* b, float* x, float* r) const {
  for_tasks(chunk_count(n, chunk), [&](Index c) {
    const Index begin = c * chunk, end = std::min(n, begin + chunk);
    if constexpr (B == 3)
      solve_earlier_3(*this, begin, end, b, x);
    else
      solve_earlier<B, K>(*this, begin, end, b, x);
  });
  for_chunks(n, kRows, [&](Index begin, Index end) {
    if constexpr (B == 3)
      leave_rest_3(*this, begin, end, b, x, r);
    else
      leave_rest<B, K>(*this, begin, end, b, x, r);
  });
}

template <int B>
template <int K>
void LevelMatrix<B>::sweep_backward(const float* b, const float* y, float* x) const {
  for_tasks(chunk_count(n, chunk), [&](Index c) {
    const Index begin = c * chunk, end = std::min(n, begin + chunk);
    if constexpr (B == 3)
      solve_later_3(*this, begin, end, b, y, x);
    else
      solve_later<B, K>(*this, begin, end, b, y, x);
  });
}

template <int B>
void LevelMatrix<B>::unbalanced(const float* step, float* change) const {
  for_chunks(n, kRows, [&](Index begin, Index end) {
    if constexpr (B == 3)
      leave_unbalanced_3(*this, begin, end, step, change);
    else
      leave_unbalanced<B>(*this, begin, end, step, change);
  });
}

template <int B>
void LevelMatrix<B>::scaled_multiply(const float* x, float* y) const {
  constexpr size_t kBlock = B * B, kRow = B;
  for_chunks(n, kRows, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      RowSum<B, 1> row;
      for (const SweepEntries* from : {&earlier, &rest})
        for (Index e = from->start[i]; e < from->start[i + 1]; ++e)
          row.subtract(from->value.data() + kBlock * e, x + kRow * from->col[e]);
      const auto scaled = row.transform(inverse_f.data() + kBlock * i, row.total());
      row.store(RowSum<B, 1>(x + kRow * i).total() - scaled / (1.0f - excess[i]), y + kRow * i);
    }
  });
}

template void LevelMatrix<1>::divide_by_diagonal<1>(const float*, float*) const;
template void LevelMatrix<1>::sweep_forward<1>(const float*, float*, float*) const;
template void LevelMatrix<1>::sweep_backward<1>(const float*, const float*, float*) const;
template void LevelMatrix<1>::divide_by_diagonal<2>(const float*, float*) const;
template void LevelMatrix<1>::sweep_forward<2>(const float*, float*, float*) const;
template void LevelMatrix<1>::sweep_backward<2>(const float*, const float*, float*) const;
template void LevelMatrix<1>::divide_by_diagonal<4>(const float*, float*) const;
template void LevelMatrix<1>::sweep_forward<4>(const float*, float*, float*) const;
template void LevelMatrix<1>::sweep_backward<4>(const float*, const float*, float*) const;
template void LevelMatrix<1>::unbalanced(const float*, float*) const;
template void LevelMatrix<1>::scaled_multiply(const float*, float*) const;
template void LevelMatrix<3>::divide_by_diagonal<1>(const float*, float*) const;
template void LevelMatrix<3>::sweep_forward<1>(const float*, float*, float*) const;
template void LevelMatrix<3>::sweep_backward<1>(const float*, const float*, float*) const;
template void LevelMatrix<3>::unbalanced(const float*, float*) const;
template void LevelMatrix<3>::scaled_multiply(const float*, float*) const;
template void LevelMatrix<6>::divide_by_diagonal<1>(const float*, float*) const;
template void LevelMatrix<6>::sweep_forward<1>(const float*, float*, float*) const;
template void LevelMatrix<6>::sweep_backward<1>(const float*, const float*, float*) const;
template void LevelMatrix<6>::unbalanced(const float*, float*) const;
template void LevelMatrix<6>::scaled_multiply(const float*, float*) const;

}  // namespace stretchmap::linalg
