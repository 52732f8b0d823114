// The single-precision part of a level matrix.
#include <Eigen/Core>

#include "level_matrix.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

// The numbers of one row, held in whole vector registers: either one block row (K = 1, lanes are
// its B unknowns and padding) or K right-hand sides of one unknown (B = 1).
template <int B, int K>
struct RowSum {
  static_assert(B == 1 || K == 1);
  static constexpr int kUsed = B * K;
  static constexpr int kLanes = kUsed <= 2 ? kUsed : (kUsed + 3) / 4 * 4;
  using Lanes = Eigen::Array<float, kLanes, 1>;
  Lanes sum;

  static Eigen::Map<const Lanes> lanes(const float* from) { return Eigen::Map<const Lanes>(from); }
  void load(const float* from) {
    sum.setZero();
    for (int k = 0; k < kUsed; ++k) sum[k] = from[k];
  }
  void store(float* to) const {
    for (int k = 0; k < kUsed; ++k) to[k] = sum[k];
  }
  // sum -= block * x; reads up to kPadding numbers beyond a column-major block.
  void subtract(const float* block, const float* x) {
    if constexpr (B == 1)
      sum -= block[0] * lanes(x);
    else
      for (int c = 0; c < B; ++c) sum -= x[c] * lanes(block + B * c);
  }
  // sum = block * sum
  void transform(const float* block) {
    if constexpr (B == 1) {
      sum *= block[0];
    } else {
      const Lanes in = sum;
      sum = in[0] * lanes(block);
      for (int c = 1; c < B; ++c) sum += in[c] * lanes(block + B * c);
    }
  }
};

}  // namespace

template <int B>
template <int K>
void LevelMatrix<B>::divide_by_diagonal(const float* r, float* z) const {
  constexpr size_t kBlock = B * B, kRow = B * K;
  for_chunks(n, [&](Index begin, Index end) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i) {
      RowSum<B, K> row;
      row.load(r + kRow * i);
      row.transform(inverse_f.data() + kBlock * i);
      row.store(z + kRow * i);
    }
  });
}

template <int B>
template <int K>
void LevelMatrix<B>::sweep_forward(const float* b, float* x, float* r) const {
  constexpr size_t kBlock = B * B, kRow = B * K;
  const auto subtract = [&](Index from, Index to, RowSum<B, K>& row) {
    for (Index e = from; e < to; ++e) row.subtract(value_f.data() + kBlock * e, x + kRow * col[e]);
  };
  for_chunks(
      n,
      [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i) {
          RowSum<B, K> row;
          row.load(b + kRow * i);
          subtract(lower[i], upper[i], row);
          row.transform(inverse_f.data() + kBlock * i);
          row.store(x + kRow * i);
        }
      },
      chunk);
  // The sweep solved the earlier columns and the diagonal exactly; the rest is the residual.
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      RowSum<B, K> row;
      row.sum.setZero();
      if (excess[i] > 0.0f) {
        row.load(b + kRow * i);
        subtract(lower[i], upper[i], row);
        row.sum *= excess[i];
      }
      subtract(start[i], lower[i], row);
      subtract(upper[i], start[i + 1], row);
      row.store(r + kRow * i);
    }
  });
}

template <int B>
template <int K>
void LevelMatrix<B>::sweep_backward(const float* b, const float* y, float* x) const {
  constexpr size_t kBlock = B * B, kRow = B * K;
  for_chunks(
      n,
      [&](Index begin, Index end) {
        for (Index i = end - 1; i >= begin; --i) {
          RowSum<B, K> row, old;
          row.load(b + kRow * i);
          old.load(y + kRow * i);
          for (Index e = start[i]; e < upper[i]; ++e)
            row.subtract(value_f.data() + kBlock * e, y + kRow * col[e]);
          for (Index e = upper[i]; e < start[i + 1]; ++e)
            row.subtract(value_f.data() + kBlock * e, x + kRow * col[e]);
          row.transform(inverse_f.data() + kBlock * i);
          row.sum += excess[i] * old.sum;
          row.store(x + kRow * i);
        }
      },
      chunk);
}

template <int B>
void LevelMatrix<B>::scaled_multiply(const float* x, float* y) const {
  constexpr size_t kBlock = B * B, kRow = B;
  for_chunks(n, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      RowSum<B, 1> row, self;
      row.sum.setZero();
      for (Index e = start[i]; e < start[i + 1]; ++e)
        row.subtract(value_f.data() + kBlock * e, x + kRow * col[e]);
      row.transform(inverse_f.data() + kBlock * i);
      self.load(x + kRow * i);
      row.sum = self.sum - row.sum / (1.0f - excess[i]);
      row.store(y + kRow * i);
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
