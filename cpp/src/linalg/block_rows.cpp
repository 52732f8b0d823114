#include "linalg/block_rows.hpp"

#include <cstddef>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

// A block row times x, in several sums so that no addition waits for the one before.
template <int B>
class BlockRowSum;

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

}  // namespace

template <int B>
template <int K>
std::array<double, K> BlockRows<B>::multiply(const double* x, double* y) const {
  static_assert(B == 1 || K == 1);
  constexpr size_t kBlock = B * B;
  return sum_chunks<K>(n, [&](Index begin, Index end, std::array<double, K>& dots) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i) {
      const auto first = static_cast<size_t>(start[i]), last = static_cast<size_t>(start[i + 1]);
      if constexpr (K > 1) {
        Lanes<double, K> total = Lanes<double, K>::Zero();
        for (size_t e = first; e < last; ++e) total += value[e] * lanes<K>(x + K * col[e]);
        total *= scale;
        Eigen::Map<Lanes<double, K>>(y + K * i) = total;
        total *= lanes<K>(x + K * i);
        for (int k = 0; k < K; ++k) dots[k] += total[k];
      } else {
        BlockRowSum<B> sum;
        for (size_t e = first; e < last; ++e)
          sum.add(value + kBlock * e, x + B * static_cast<size_t>(col[e]));
        sum.store(y + B * i);
        for (int r = 0; r < B; ++r) {
          y[B * i + r] *= scale;
          dots[0] += x[B * i + r] * y[B * i + r];
        }
      }
    }
  });
}

template std::array<double, 1> BlockRows<1>::multiply<1>(const double*, double*) const;
template std::array<double, 2> BlockRows<1>::multiply<2>(const double*, double*) const;
template std::array<double, 4> BlockRows<1>::multiply<4>(const double*, double*) const;
template std::array<double, 1> BlockRows<3>::multiply<1>(const double*, double*) const;

}  // namespace stretchmap::linalg
