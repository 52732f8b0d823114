#include "linalg/multigrid/dense_inverse.hpp"

#include <algorithm>
#include <cmath>

#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::linalg {
namespace {

using std::size_t;

constexpr Index kLargest = 3000;  // unknowns; more are not inverted, even if coarsening stalls

}  // namespace

void DenseInverse::set(const Pattern& pattern, const Buffer<double>& values, int block) {
  n_ = pattern.rows() * block;
  inverse_.clear();
  if (n_ > kLargest) return;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n_, n_);
  for (Index i = 0; i < pattern.rows(); ++i)
    for (Index e = pattern.start[i]; e < pattern.start[i + 1]; ++e)
      for (int r = 0; r < block; ++r)
        for (int c = 0; c < block; ++c)
          dense(i * block + r, pattern.col[e] * block + c) =
              values[static_cast<size_t>(block * block) * e + block * r + c];
  Eigen::MatrixXd inverse(n_, n_);
  if (!invert_positive(dense, inverse))
    inverse = map_eigenvalues(dense, [](double value, double largest) {
      return 1.0 / std::max({std::abs(value), 1e-8 * largest, 1e-300});
    });
  const Eigen::MatrixXf symmetric = (0.5 * (inverse + inverse.transpose())).cast<float>();
  inverse_.assign(symmetric.data(), symmetric.data() + symmetric.size());
}

template <int N>
void DenseInverse::apply(const float* b, float* x) const {
  std::fill_n(x, static_cast<size_t>(N) * n_, 0.0f);
  if (inverse_.empty()) return;
  for_chunks(n_, kChunk / 16, [&](Index begin, Index end) {
    for (Index j = 0; j < n_; ++j) {
      const float* column = inverse_.data() + static_cast<size_t>(n_) * j;
      for (size_t i = begin; i < static_cast<size_t>(end); ++i)
        for (int k = 0; k < N; ++k) x[N * i + k] += column[i] * b[static_cast<size_t>(N) * j + k];
    }
  });
}

template void DenseInverse::apply<1>(const float*, float*) const;
template void DenseInverse::apply<2>(const float*, float*) const;
template void DenseInverse::apply<4>(const float*, float*) const;

}  // namespace stretchmap::linalg
