// Loops over rows in fixed chunks: what a chunk computes, and the order in which partial sums are
// added, do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap {

// N numbers that are added and multiplied together. A loop of rows over them has to be told, or the
// compiler takes several entries of a row at once, which are too few.
template <class Real, int N>
using Lanes = Eigen::Array<Real, N, 1>;
template <int N, class Real>
Eigen::Map<const Lanes<Real, N>> lanes(const Real* from) {
  return Eigen::Map<const Lanes<Real, N>>(from);
}

inline constexpr Index kChunk = 2048;  // rows per chunk

inline Index chunk_count(Index n, Index size = kChunk) { return (n + size - 1) / size; }

// body(begin, end) for every chunk of [0, n).
template <class Body>
void for_chunks(Index n, const Body& body, Index size = kChunk) {
  const Index chunks = chunk_count(n, size);
#pragma omp parallel for schedule(static) if (chunks > 3)
  for (Index c = 0; c < chunks; ++c) body(c * size, std::min(n, (c + 1) * size));
}

// The same with a workspace per thread, made by make(); results must not depend on which.
template <class Make, class Body>
void for_chunks_with(Index n, const Make& make, const Body& body, Index size = kChunk) {
  const Index chunks = chunk_count(n, size);
#pragma omp parallel if (chunks > 3)
  {
    auto workspace = make();
#pragma omp for schedule(static)
    for (Index c = 0; c < chunks; ++c) body(c * size, std::min(n, (c + 1) * size), workspace);
  }
}

// body(begin, end, sums) adds to sums[0 .. K-1]; the chunks' sums are added in order.
template <int K, class Body>
std::array<double, K> sum_chunks(Index n, const Body& body) {
  const Index chunks = chunk_count(n);
  std::vector<std::array<double, K>> partial(static_cast<std::size_t>(chunks));
#pragma omp parallel for schedule(static) if (chunks > 3)
  for (Index c = 0; c < chunks; ++c) {
    std::array<double, K> sums{};
    body(c * kChunk, std::min(n, (c + 1) * kChunk), sums);
    partial[static_cast<std::size_t>(c)] = sums;
  }
  std::array<double, K> total{};
  for (const auto& sums : partial)
    for (int k = 0; k < K; ++k) total[k] += sums[k];
  return total;
}

}  // namespace stretchmap
