#include "linalg/multigrid/aggregation.hpp"

#include <cmath>

namespace stretchmap::linalg {
namespace {

template <int B>
double coupling(const LevelMatrix<B>& A, Index e) {
  const auto block = A.block(e);
  if constexpr (B == 1) return -block[0];
  double sum = 0.0;
  for (const double a : block) sum += a * a;
  return std::sqrt(sum);
}

template <int B>
std::vector<char> strong_entries(const LevelMatrix<B>& A, double threshold) {
  std::vector<double> largest(A.n, 0.0);
  for_chunks(A.n, LevelMatrix<B>::kRows, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for (Index e = A.start[i]; e < A.start[i + 1]; ++e)
        largest[i] = std::max(largest[i], coupling<B>(A, e));
  });
  std::vector<char> strong(A.col.size(), 0);
  for_chunks(A.n, LevelMatrix<B>::kRows, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for (Index e = A.start[i]; e < A.start[i + 1]; ++e) {
        const double c = coupling<B>(A, e);
        strong[e] = c > 0.0 && c >= threshold * std::min(largest[i], largest[A.col[e]]);
      }
  });
  return strong;
}

}  // namespace

template <int B>
Aggregates aggregate(const LevelMatrix<B>& A, double threshold) {
  Aggregates result;
  result.strong = strong_entries(A, threshold);
  constexpr Index kFree = -2;
  std::vector<Index>& of = result.of;
  of.assign(A.n, kFree);
  const auto each_strong = [&](Index i, const auto& visit) {
    for (Index e = A.start[i]; e < A.start[i + 1]; ++e)
      if (result.strong[e]) visit(A.col[e], e);
  };
  // Full neighborhoods that touch no other aggregate.
  for (Index i = 0; i < A.n; ++i) {
    bool alone = true, free = of[i] == kFree;
    each_strong(i, [&](Index j, Index) {
      alone = false;
      free = free && of[j] == kFree;
    });
    if (alone) of[i] = -1;
    if (alone || !free) continue;
    of[i] = result.count;
    each_strong(i, [&](Index j, Index) { of[j] = result.count; });
    ++result.count;
  }
  // The others join the neighbor they are coupled to most.
  const std::vector<Index> first = of;
  for (Index i = 0; i < A.n; ++i) {
    if (first[i] != kFree) continue;
    double best = 0.0;
    each_strong(i, [&](Index j, Index e) {
      if (first[j] < 0 || coupling<B>(A, e) <= best) return;
      best = coupling<B>(A, e);
      of[i] = first[j];
    });
  }
  // What is left forms aggregates of its own.
  for (Index i = 0; i < A.n; ++i) {
    if (of[i] != kFree) continue;
    of[i] = result.count;
    each_strong(i, [&](Index j, Index) {
      if (of[j] == kFree) of[j] = result.count;
    });
    ++result.count;
  }
  return result;
}

template Aggregates aggregate(const LevelMatrix<1>&, double);
template Aggregates aggregate(const LevelMatrix<3>&, double);
template Aggregates aggregate(const LevelMatrix<6>&, double);

}  // namespace stretchmap::linalg
