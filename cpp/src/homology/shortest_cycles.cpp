#include "stretchmap/homology/shortest_cycles.hpp"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <utility>

#include "homology/face_cut.hpp"
#include "homology/shortest_paths.hpp"

namespace stretchmap::homology {
namespace {

// A cut that spares less than this share of the length is rounding.
constexpr double kRounding = 1e-12;

double length_of(const VecRef& edge_length, const IndexVec& cycle) {
  return edge_length.dot(cycle.cwiseAbs().cast<double>());
}

// The cycle with the boundaries of the faces added that make it shortest when added once.
IndexVec shortened(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                   const IndexVec& cycle, const Poll& poll) {
  Vec capacity(top.twin.size()), supply = Vec::Zero(top.faces.rows());
  for (Index h = 0; h < top.twin.size(); ++h) {
    const Index e = top.edge[h], turns = top.sign(h) > 0 ? cycle[e] : -cycle[e];
    capacity[h] = turns == 0 ? edge_length[e] : 0.0;
    if (turns != 0) supply[h / 3] += turns < 0 ? edge_length[e] : -edge_length[e];
  }
  const std::vector<char> added = least_cut(top, std::move(capacity), std::move(supply), poll);
  IndexVec sum = cycle;
  for (Index h = 0; h < top.twin.size(); ++h)
    if (added[h / 3]) sum[top.edge[h]] += top.sign(h) > 0 ? 1 : -1;
  return sum;
}

// How often each half-edge is walked; taken apart into loops.
class Walks {
 public:
  explicit Walks(const mesh::SurfaceTopology& top) : top_(top), left_(top.twin.size(), 0) {}

  void add(Index h, Index times = 1) { left_[h] += times; }

  // A half-edge to leave vertex i by, which is used up; -1 where there is none.
  Index leave(Index i) {
    const Index first = top_.vertex_halfedge[i];
    Index h = first;
    do {
      if (left_[h] > 0) {
        --left_[h];
        return h;
      }
      h = top_.turned(h);
    } while (h != first);
    return -1;
  }

  // A loop is cut off wherever the walk comes back to a vertex.
  std::vector<Loop> simple_loops() {
    std::vector<Loop> loops;
    std::vector<Index> place(top_.n_vertices, -1);
    Loop path;
    for (Index start = 0; start < top_.n_vertices; ++start) {
      Index i = start;
      for (;;) {
        if (place[i] < 0) {
          place[i] = static_cast<Index>(path.size());
          path.push_back(i);
        } else {
          loops.emplace_back(path.begin() + place[i], path.end());
          for (const Index k : loops.back()) place[k] = -1;
          path.resize(path.size() - loops.back().size());
          place[i] = static_cast<Index>(path.size());
          path.push_back(i);
        }
        const Index h = leave(i);
        if (h < 0) break;
        i = top_.head(h);
      }
      path.clear();
      place[start] = -1;
    }
    return loops;
  }

  // All that hangs together with vertex `start` as one closed walk.
  Loop circuit(Index start) {
    Loop open{start}, walk;
    while (!open.empty()) {
      if (const Index h = leave(open.back()); h >= 0) {
        open.push_back(top_.head(h));
      } else {
        walk.push_back(open.back());
        open.pop_back();
      }
    }
    std::reverse(walk.begin(), walk.end());
    walk.pop_back();
    return walk;
  }

 private:
  const mesh::SurfaceTopology& top_;
  std::vector<Index> left_;
};

}  // namespace

std::vector<Loop> shortest_cycles(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                                  const std::vector<Loop>& loops, const IndexVecRef& multiples,
                                  const Poll& poll) {
  IndexVec cycle = IndexVec::Zero(top.edges.rows());
  for (std::size_t l = 0; l < loops.size(); ++l)
    for (const Index h : loop_halfedges(top, loops[l]))
      cycle[top.edge[h]] += top.sign(h) > 0 ? multiples[l] : -multiples[l];
  double length = length_of(edge_length, cycle);
  for (;;) {
    IndexVec next = shortened(top, edge_length, cycle, poll);
    const double less = length_of(edge_length, next);
    if (!(less < (1.0 - kRounding) * length)) break;
    length = less;
    cycle = std::move(next);
  }
  Walks walks(top);
  for (Index e = 0; e < cycle.size(); ++e) {
    const Index h = top.edge_halfedge[e];
    if (cycle[e] != 0) walks.add(cycle[e] > 0 ? h : top.twin[h], std::abs(cycle[e]));
  }
  return walks.simple_loops();
}

Loop joined_loops(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                  const std::vector<Loop>& loops) {
  Walks walks(top);
  std::vector<std::vector<Index>> apart;
  for (const Loop& loop : loops) {
    apart.push_back(loop_halfedges(top, loop));
    for (const Index h : apart.back()) walks.add(h);
  }
  ShortestPaths paths(top, edge_length);
  Loop together;
  std::vector<char> is_together(top.n_vertices, 0);
  const auto add = [&](Index i) {
    if (!is_together[i]) together.push_back(i);
    is_together[i] = 1;
  };
  const auto take = [&](std::size_t l) {
    for (const Index i : loops[l]) add(i);
    apart[l].clear();
  };
  if (!loops.empty()) take(0);
  for (;;) {
    std::vector<char> goal(top.n_vertices, 0);
    bool any = false;
    for (const std::vector<Index>& loop : apart)
      for (const Index h : loop) goal[top.tail(h)] = any = true;
    if (!any) break;
    Index end = -1;
    paths.grow(together, std::numeric_limits<double>::infinity(), [&](Index i) {
      if (goal[i]) end = i;
      return goal[i] != 0;
    });
    for (Index i = end; i >= 0 && paths.entered(i) >= 0; i = top.tail(paths.entered(i))) {
      walks.add(paths.entered(i));
      walks.add(top.twin[paths.entered(i)]);
      add(i);
    }
    for (std::size_t l = 0; l < loops.size(); ++l) {
      const auto meets = [&](Index h) { return is_together[top.tail(h)] != 0; };
      if (std::any_of(apart[l].begin(), apart[l].end(), meets)) take(l);
    }
  }
  return loops.empty() ? Loop{} : walks.circuit(loops[0][0]);
}

}  // namespace stretchmap::homology
