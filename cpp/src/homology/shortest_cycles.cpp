#include "stretchmap/homology/shortest_cycles.hpp"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include "homology/face_cut.hpp"

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
      h = top_.twin[mesh::SurfaceTopology::prev(h)];
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

// The half-edges of a shortest path from marked vertices to a vertex of `goal`.
std::vector<Index> shortest_path(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                                 const std::vector<char>& marked, const std::vector<char>& goal) {
  using Entry = std::pair<double, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
  std::vector<double> distance(top.n_vertices, std::numeric_limits<double>::infinity());
  std::vector<Index> entered(top.n_vertices, -1), path;
  for (Index i = 0; i < top.n_vertices; ++i) {
    if (!marked[i]) continue;
    distance[i] = 0.0;
    queue.emplace(0.0, i);
  }
  while (!queue.empty()) {
    const auto [so_far, i] = queue.top();
    queue.pop();
    if (so_far > distance[i]) continue;
    if (goal[i]) {
      for (Index k = i; entered[k] >= 0; k = top.tail(entered[k])) path.push_back(entered[k]);
      break;
    }
    const Index first = top.vertex_halfedge[i];
    Index h = first;
    do {
      const Index j = top.head(h);
      if (const double there = so_far + edge_length[top.edge[h]]; there < distance[j]) {
        distance[j] = there;
        entered[j] = h;
        queue.emplace(there, j);
      }
      h = top.twin[mesh::SurfaceTopology::prev(h)];
    } while (h != first);
  }
  return path;
}

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
  std::vector<char> together(top.n_vertices, 0);
  const auto take = [&](std::size_t l) {
    for (const Index i : loops[l]) together[i] = 1;
    apart[l].clear();
  };
  if (!loops.empty()) take(0);
  for (;;) {
    std::vector<char> goal(top.n_vertices, 0);
    bool any = false;
    for (std::size_t l = 0; l < loops.size(); ++l)
      for (const Index h : apart[l]) {
        goal[top.tail(h)] = 1;
        any = true;
      }
    if (!any) break;
    const std::vector<Index> path = shortest_path(top, edge_length, together, goal);
    for (const Index h : path) {
      walks.add(h);
      walks.add(top.twin[h]);
      together[top.tail(h)] = together[top.head(h)] = 1;
    }
    for (std::size_t l = 0; l < loops.size(); ++l) {
      const auto meets = [&](Index h) { return together[top.tail(h)] != 0; };
      if (std::any_of(apart[l].begin(), apart[l].end(), meets)) take(l);
    }
  }
  return loops.empty() ? Loop{} : walks.circuit(loops[0][0]);
}

}  // namespace stretchmap::homology
