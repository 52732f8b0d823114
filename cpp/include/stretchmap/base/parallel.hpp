// Loops over rows in fixed chunks: what a chunk computes, and the order in which partial sums are
// added, do not depend on the number of threads. How many share a loop is decided by its chunks,
// each of which should be worth some ten microseconds: a thread gets one of them or is not called.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <exception>
#include <vector>

#include "stretchmap/base/buffer.hpp"
#include "stretchmap/base/threads.hpp"
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

// Rows per chunk that take some nanoseconds each, a tenth of a microsecond, and a microsecond.
inline constexpr Index kChunk = 2048, kElementChunk = 512, kCostlyChunk = 64;

inline Index chunk_count(Index n, Index size = kChunk) { return (n + size - 1) / size; }

// work(shares) by every thread that takes part. What one of them throws, the first if several do,
// is thrown once all are done.
template <class Work>
void share_chunks(Index chunks, Work& work) {
  struct Shared {
    Work& work;
    std::atomic_flag failed = ATOMIC_FLAG_INIT;
    std::exception_ptr error = nullptr;
  } shared{work};
  share_out(
      chunks,
      [](void* context, Shares& shares) noexcept {
        Shared& all = *static_cast<Shared*>(context);
        try {
          all.work(shares);
        } catch (...) {
          if (!all.failed.test_and_set()) all.error = std::current_exception();
        }
      },
      &shared);
  if (shared.error) std::rethrow_exception(shared.error);
}

// body(task) for every task of [0, count), each of them worth a thread.
template <class Body>
void for_tasks(Index count, const Body& body) {
  auto work = [&](Shares& shares) {
    for (Index task = shares.next(); task >= 0; task = shares.next()) body(task);
  };
  share_chunks(count, work);
}

// body(begin, end) for every chunk of [0, n).
template <class Body>
void for_chunks(Index n, Index size, const Body& body) {
  const Index chunks = chunk_count(n, size);
  auto work = [&](Shares& shares) {
    for (Index c = shares.next(); c >= 0; c = shares.next())
      body(c * size, std::min(n, (c + 1) * size));
  };
  share_chunks(chunks, work);
}
template <class Body>
void for_chunks(Index n, const Body& body) {
  for_chunks(n, kChunk, body);
}

// body(i) for every i of [0, n).
template <class Body>
void for_rows(Index n, Index size, const Body& body) {
  for_chunks(n, size, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) body(i);
  });
}
template <class Body>
void for_rows(Index n, const Body& body) {
  for_rows(n, kChunk, body);
}

// As for_chunks with a workspace per thread, made by make(); results must not depend on which.
template <class Make, class Body>
void for_chunks_with(Index n, Index size, const Make& make, const Body& body) {
  const Index chunks = chunk_count(n, size);
  auto work = [&](Shares& shares) {
    Index c = shares.next();
    if (c < 0) return;
    for (auto workspace = make(); c >= 0; c = shares.next())
      body(c * size, std::min(n, (c + 1) * size), workspace);
  };
  share_chunks(chunks, work);
}

// body(begin, end, sums) adds to sums[0 .. K-1]; the chunks' sums are added in order.
template <int K, class Body>
std::array<double, K> sum_chunks(Index n, const Body& body) {
  std::vector<std::array<double, K>> partial(static_cast<std::size_t>(chunk_count(n)));
  for_chunks(n, [&](Index begin, Index end) {
    std::array<double, K> sums{};
    body(begin, end, sums);
    partial[static_cast<std::size_t>(begin / kChunk)] = sums;
  });
  std::array<double, K> total{};
  for (const auto& sums : partial)
    for (int k = 0; k < K; ++k) total[k] += sums[k];
  return total;
}

// The least of `most` and of all value(i) that compare with it, i of [0, n).
template <class Value>
double least_of(Index n, double most, const Value& value) {
  std::vector<double> least(static_cast<std::size_t>(chunk_count(n, kElementChunk)), most);
  for_chunks(n, kElementChunk, [&](Index begin, Index end) {
    double& mine = least[static_cast<std::size_t>(begin / kElementChunk)];
    for (Index i = begin; i < end; ++i) mine = std::min(mine, value(i));
  });
  for (const double other : least) most = std::min(most, other);
  return most;
}

// The parts one after the other, and `more` numbers unset.
template <class T>
Buffer<T> joined(const std::vector<std::vector<T>>& parts, std::size_t more = 0) {
  std::vector<std::size_t> start{0};
  for (const std::vector<T>& part : parts) start.push_back(start.back() + part.size());
  Buffer<T> all(start.back() + more);
  for_rows(static_cast<Index>(parts.size()), 4,
           [&](Index p) { std::copy(parts[p].begin(), parts[p].end(), all.begin() + start[p]); });
  return all;
}

}  // namespace stretchmap
