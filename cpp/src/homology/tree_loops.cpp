#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <utility>

#include "stretchmap/homology/shortest_cycles.hpp"

namespace stretchmap::homology {
namespace {

// Shortest paths from one vertex at a time, and the integrals of the marks along them.
class MarkedTree {
 public:
  MarkedTree(const mesh::SurfaceTopology& top, const VecRef& edge_length,
             const Eigen::Ref<const MarkRows>& marks)
      : top_(top),
        edge_length_(edge_length),
        marks_(marks),
        distance_(top.n_vertices, std::numeric_limits<double>::infinity()),
        entered_(top.n_vertices, -1),
        sums_(top.n_vertices) {}

  // To all vertices nearer than the limit.
  void grow(Index root, double limit) {
    for (const Index i : reached_) {
      distance_[i] = std::numeric_limits<double>::infinity();
      entered_[i] = -1;
    }
    reached_.clear();
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
    distance_[root] = 0.0;
    sums_[root] = {};
    queue.emplace(0.0, root);
    while (!queue.empty()) {
      const auto [so_far, i] = queue.top();
      queue.pop();
      if (so_far > distance_[i]) continue;
      reached_.push_back(i);
      if (entered_[i] >= 0) sums_[i] = beyond(entered_[i]);
      each_outgoing(i, [&](Index h) {
        const Index j = top_.head(h);
        const double there = so_far + edge_length_[top_.edge[h]];
        if (!(there < distance_[j]) || !(there < limit)) return;
        distance_[j] = there;
        entered_[j] = h;
        queue.emplace(there, j);
      });
    }
  }

  // visit(h, length, period) for the half-edges, one of each edge, that close a loop.
  template <class Visit>
  void each_loop(const Visit& visit) const {
    for (const Index i : reached_) {
      each_outgoing(i, [&](Index h) {
        const Index j = top_.head(h);
        if (i > j || distance_[j] == std::numeric_limits<double>::infinity()) return;
        if (entered_[j] == h || entered_[i] == top_.twin[h]) return;
        Mark period = beyond(h);
        for (int k = 0; k < 2; ++k) period[k] -= sums_[j][k];
        visit(h, distance_[i] + edge_length_[top_.edge[h]] + distance_[j], period);
      });
    }
  }

  // Without the way from the root that both of its paths have in common.
  Loop loop(Index h) const {
    Loop there = path_to(top_.tail(h)), back = path_to(top_.head(h));
    std::size_t common = 1;
    while (common < std::min(there.size(), back.size()) && there[common] == back[common]) ++common;
    Loop closed(there.begin() + static_cast<std::ptrdiff_t>(common - 1), there.end());
    closed.insert(closed.end(), back.rbegin(), back.rend() - static_cast<std::ptrdiff_t>(common));
    return closed;
  }

 private:
  using Mark = std::array<std::uint64_t, 2>;

  template <class Visit>
  void each_outgoing(Index i, const Visit& visit) const {
    Index h = top_.vertex_halfedge[i];
    do {
      visit(h);
      h = top_.twin[mesh::SurfaceTopology::prev(h)];
    } while (h != top_.vertex_halfedge[i]);
  }

  // The integrals along the path to the tail of h, and h.
  Mark beyond(Index h) const {
    Mark sum = sums_[top_.tail(h)];
    for (int k = 0; k < 2; ++k) {
      const std::uint64_t step = marks_(k, top_.edge[h]);
      sum[k] += top_.sign(h) > 0 ? step : std::uint64_t{0} - step;
    }
    return sum;
  }

  Loop path_to(Index i) const {
    Loop path{i};
    for (; entered_[i] >= 0; path.push_back(i)) i = top_.tail(entered_[i]);
    std::reverse(path.begin(), path.end());
    return path;
  }

  const mesh::SurfaceTopology& top_;
  const VecRef& edge_length_;
  const Eigen::Ref<const MarkRows>& marks_;
  std::vector<double> distance_;
  std::vector<Index> entered_, reached_;
  std::vector<Mark> sums_;
};

}  // namespace

std::vector<Loop> tree_loops(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                             const Eigen::Ref<const MarkRows>& marks,
                             const std::vector<Index>& roots, double limit, const Poll& poll) {
  MarkedTree tree(top, edge_length, marks);
  std::map<std::uint64_t, std::pair<double, Loop>> shortest;  // of each class
  for (const Index root : roots) {
    if (poll) poll();
    tree.grow(root, 0.5 * limit);
    tree.each_loop([&](Index h, double length, const auto& period) {
      if (period[0] != 0 || period[1] == 0 || !(length < limit)) return;
      const std::uint64_t name = std::min(period[1], std::uint64_t{0} - period[1]);
      const auto found = shortest.find(name);
      if (found == shortest.end())
        shortest.emplace(name, std::pair(length, tree.loop(h)));
      else if (length < found->second.first)
        found->second = {length, tree.loop(h)};
    });
  }
  std::vector<std::pair<double, Loop>> all;
  all.reserve(shortest.size());
  for (auto& [name, one] : shortest) all.push_back(std::move(one));
  std::sort(all.begin(), all.end());
  std::vector<Loop> loops;
  loops.reserve(all.size());
  for (auto& [length, loop] : all) loops.push_back(std::move(loop));
  return loops;
}

}  // namespace stretchmap::homology
