// The single-precision part of a level matrix.
#include <Eigen/Core>
#include <algorithm>

#include "linalg/multigrid/level_matrix.hpp"

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
  using Lanes = Eigen::Array<float, kLanes, 1>;

 public:
  RowSum() {
    for (Lanes& sum : part_) sum.setZero();
  }
  explicit RowSum(const float* from) : RowSum() {
    for (int k = 0; k < kUsed; ++k) part_[0][k] = from[k];
  }
  // this -= block * x; reads up to kPadding numbers beyond a column-major block.
  void subtract(const float* block, const float* x) {
    if constexpr (B == 1)
      part_[0] -= block[0] * lanes(x);
    else
      for (int c = 0; c < B; ++c) part_[c] -= x[c] * lanes(block + B * c);
  }
  Lanes total() const {
    Lanes sum = part_[0];
    for (int c = 1; c < B; ++c) sum += part_[c];
    return sum;
  }
  // block * sum
  static Lanes transform(const float* block, const Lanes& sum) {
    if constexpr (B == 1) return block[0] * sum;
    Lanes out = sum[0] * lanes(block);
    for (int c = 1; c < B; ++c) out += sum[c] * lanes(block + B * c);
    return out;
  }
  static void store(const Lanes& sum, float* to) {
    for (int k = 0; k < kUsed; ++k) to[k] = sum[k];
  }

 private:
  static Eigen::Map<const Lanes> lanes(const float* from) { return Eigen::Map<const Lanes>(from); }
  Lanes part_[B];
};

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
  constexpr size_t kBlock = B * B, kRow = B * K;
  const auto subtract = [&](const SweepEntries& from, Index i, RowSum<B, K>& row) {
    for (Index e = from.start[i]; e < from.start[i + 1]; ++e)
      row.subtract(from.value.data() + kBlock * e, x + kRow * from.col[e]);
  };
  for_tasks(chunk_count(n, chunk), [&](Index c) {
    const Index begin = c * chunk, end = std::min(n, begin + chunk);
    for (Index i = begin; i < end; ++i) {
      RowSum<B, K> row(b + kRow * i);
      subtract(earlier, i, row);
      row.store(row.transform(inverse_f.data() + kBlock * i, row.total()), x + kRow * i);
    }
  });
  // The sweep solved the earlier columns and the diagonal exactly; the rest is the residual.
  for_chunks(n, kRows, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      RowSum<B, K> row;
      subtract(rest, i, row);
      auto total = row.total();
      if (excess[i] > 0.0f) {
        RowSum<B, K> enlarged(b + kRow * i);
        subtract(earlier, i, enlarged);
        total += excess[i] * enlarged.total();
      }
      row.store(total, r + kRow * i);
    }
  });
}

template <int B>
template <int K>
void LevelMatrix<B>::sweep_backward(const float* b, const float* y, float* x) const {
  constexpr size_t kBlock = B * B, kRow = B * K;
  for_tasks(chunk_count(n, chunk), [&](Index c) {
    const Index begin = c * chunk, end = std::min(n, begin + chunk);
    for (Index i = end - 1; i >= begin; --i) {
      // Backwards through memory, too; the nearest row, whose result was written last, at the
      // end of what waits for such.
      RowSum<B, K> known(b + kRow * i), next;
      for (Index e = rest.start[i + 1] - 1; e >= later[i]; --e)
        next.subtract(rest.value.data() + kBlock * e, x + kRow * rest.col[e]);
      for (Index e = later[i] - 1; e >= rest.start[i]; --e)
        known.subtract(rest.value.data() + kBlock * e, y + kRow * rest.col[e]);
      for (Index e = earlier.start[i + 1] - 1; e >= earlier.start[i]; --e)
        known.subtract(earlier.value.data() + kBlock * e, y + kRow * earlier.col[e]);
      auto moved = known.transform(inverse_f.data() + kBlock * i, known.total() + next.total());
      moved += excess[i] * RowSum<B, K>(y + kRow * i).total();
      known.store(moved, x + kRow * i);
    }
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
template void LevelMatrix<1>::scaled_multiply(const float*, float*) const;
template void LevelMatrix<3>::divide_by_diagonal<1>(const float*, float*) const;
template void LevelMatrix<3>::sweep_forward<1>(const float*, float*, float*) const;
template void LevelMatrix<3>::sweep_backward<1>(const float*, const float*, float*) const;
template void LevelMatrix<3>::scaled_multiply(const float*, float*) const;
template void LevelMatrix<6>::divide_by_diagonal<1>(const float*, float*) const;
template void LevelMatrix<6>::sweep_forward<1>(const float*, float*, float*) const;
template void LevelMatrix<6>::sweep_backward<1>(const float*, const float*, float*) const;
template void LevelMatrix<6>::scaled_multiply(const float*, float*) const;

}  // namespace stretchmap::linalg
