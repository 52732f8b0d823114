// Shortest paths along the edges of a closed surface.
#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

class ShortestPaths {
 public:
  ShortestPaths(const mesh::SurfaceTopology& top, const VecRef& edge_length)
      : top_(top),
        edge_length_(edge_length),
        distance_(top.n_vertices, kUnreached),
        entered_(top.n_vertices, -1) {}

  // From some vertices to all nearer than the limit, nearest first, until enough(i) of one.
  // Forgets what it found before.
  template <class Enough>
  void grow(const std::vector<Index>& roots, double limit, const Enough& enough) {
    for (const Index i : touched_) {
      distance_[i] = kUnreached;
      entered_[i] = -1;
    }
    touched_.clear();
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
    const auto reach = [&](Index i, double there, Index by) {
      if (distance_[i] == kUnreached) touched_.push_back(i);
      distance_[i] = there;
      entered_[i] = by;
      queue.emplace(there, i);
    };
    for (const Index i : roots) reach(i, 0.0, -1);
    while (!queue.empty()) {
      const auto [so_far, i] = queue.top();
      queue.pop();
      if (so_far > distance_[i]) continue;
      if (enough(i)) return;
      top_.each_outgoing(i, [&, so_far = so_far](Index h) {
        const double there = so_far + edge_length_[top_.edge[h]];
        if (there < distance_[top_.head(h)] && there < limit) reach(top_.head(h), there, h);
      });
    }
  }

  // Infinite for a vertex that was not reached.
  double distance(Index i) const { return distance_[i]; }
  bool reached(Index i) const { return distance_[i] != kUnreached; }

  // The half-edge that enters a vertex, -1 for a root.
  Index entered(Index i) const { return entered_[i]; }

  // Vertices from a root to vertex i.
  Loop path_to(Index i) const {
    Loop path{i};
    while (entered_[i] >= 0) path.push_back(i = top_.tail(entered_[i]));
    std::reverse(path.begin(), path.end());
    return path;
  }

  // From the root of a tree to the tail of h, along h and back, without the way that both have in
  // common.
  Loop loop_closed_by(Index h) const {
    const Loop there = path_to(top_.tail(h)), back = path_to(top_.head(h));
    std::size_t common = 1;
    while (common < std::min(there.size(), back.size()) && there[common] == back[common]) ++common;
    Loop loop(there.begin() + static_cast<std::ptrdiff_t>(common - 1), there.end());
    loop.insert(loop.end(), back.rbegin(), back.rend() - static_cast<std::ptrdiff_t>(common));
    return loop;
  }

 private:
  static constexpr double kUnreached = std::numeric_limits<double>::infinity();

  const mesh::SurfaceTopology& top_;
  const VecRef& edge_length_;
  std::vector<double> distance_;
  std::vector<Index> entered_, touched_;
};

}  // namespace stretchmap::homology
