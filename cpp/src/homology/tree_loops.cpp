#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "homology/shortest_paths.hpp"
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
        paths_(top, edge_length),
        sums_(top.n_vertices) {}

  // To all vertices nearer than the limit.
  void grow(Index root, double limit) {
    reached_.clear();
    paths_.grow({root}, limit, [&](Index i) {
      reached_.push_back(i);
      sums_[i] = paths_.entered(i) < 0 ? Mark{} : beyond(paths_.entered(i));
      return false;
    });
  }

  // visit(h, length, period) for the half-edges, one of each edge, that close a loop.
  template <class Visit>
  void each_loop(const Visit& visit) const {
    for (const Index i : reached_) {
      top_.each_outgoing(i, [&](Index h) {
        const Index j = top_.head(h);
        if (i > j || !paths_.reached(j)) return;
        if (paths_.entered(j) == h || paths_.entered(i) == top_.twin[h]) return;
        Mark period = beyond(h);
        for (int k = 0; k < 2; ++k) period[k] -= sums_[j][k];
        visit(h, paths_.distance(i) + edge_length_[top_.edge[h]] + paths_.distance(j), period);
      });
    }
  }

  Loop loop(Index h) const { return paths_.loop_closed_by(h); }

 private:
  using Mark = std::array<std::uint64_t, 2>;

  // The integrals along the path to the tail of h, and h.
  Mark beyond(Index h) const {
    Mark sum = sums_[top_.tail(h)];
    for (int k = 0; k < 2; ++k) {
      const std::uint64_t step = marks_(k, top_.edge[h]);
      sum[k] += top_.sign(h) > 0 ? step : std::uint64_t{0} - step;
    }
    return sum;
  }

  const mesh::SurfaceTopology& top_;
  const VecRef& edge_length_;
  const Eigen::Ref<const MarkRows>& marks_;
  ShortestPaths paths_;
  std::vector<Index> reached_;
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
