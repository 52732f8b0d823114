#include "homology/annulus_loop.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include "stretchmap/base/incidence.hpp"

namespace stretchmap::homology {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The edge graph of a surface cut open along some edges. A vertex on the cut has one node for each
// fan of faces between cut edges.
struct CutGraph {
  struct Arc {
    double length;
    Index to;
  };
  std::vector<Index> tail;    // (3m) node at the tail of a half-edge, on the side of its face
  std::vector<Index> vertex;  // of each node
  Incidence<Arc> arcs;        // of each node

  Index size() const { return static_cast<Index>(vertex.size()); }
  Index left(Index h) const { return tail[h]; }
  Index left_head(Index h) const { return tail[mesh::SurfaceTopology::next(h)]; }
};

CutGraph cut_open(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                  const std::vector<char>& is_cut) {
  CutGraph graph;
  graph.tail.resize(top.twin.size());
  for (Index i = 0; i < top.n_vertices; ++i) {
    Index first = top.vertex_halfedge[i];
    while (!is_cut[top.edge[first]] && top.turned(first) != top.vertex_halfedge[i]) {
      first = top.turned(first);
    }
    Index h = first;
    do {
      if (h == first || is_cut[top.edge[h]]) graph.vertex.push_back(i);
      graph.tail[h] = graph.size() - 1;
      h = top.turned(h);
    } while (h != first);
  }
  // An edge that is not cut is walked one way by each of its half-edges, a cut one both ways.
  graph.arcs = Incidence<CutGraph::Arc>(graph.size(), [&](const auto& visit) {
    for (Index h = 0; h < top.twin.size(); ++h) {
      const Index e = top.edge[h], i = graph.left(h), j = graph.left_head(h);
      visit(i, CutGraph::Arc{edge_length[e], j});
      if (is_cut[e]) visit(j, CutGraph::Arc{edge_length[e], i});
    }
  });
  return graph;
}

// Shortest paths in a cut graph from several nodes, under a consistent estimate of what remains.
class PathSearch {
 public:
  PathSearch(const CutGraph& graph, const Poll& poll)
      : graph_(graph),
        poll_(poll),
        distance_(graph.size()),
        parent_(graph.size()),
        stamp_(graph.size(), 0) {}

  // Runs until a node with goal(i) is settled and returns it; -1 where estimate and distance reach
  // the cutoff before.
  template <class Goal, class Estimate>
  Index run(const std::vector<Index>& sources, double cutoff, const Goal& goal,
            const Estimate& estimate) {
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
    ++now_;
    const auto reach = [&](Index i, double distance, Index from) {
      if (distance >= this->distance(i)) return;
      const double total = distance + estimate(i);
      if (!(total < cutoff)) return;
      distance_[i] = distance;
      parent_[i] = from;
      stamp_[i] = now_;
      queue.emplace(total, i);
    };
    for (const Index i : sources) reach(i, 0.0, -1);
    while (!queue.empty()) {
      const auto [total, i] = queue.top();
      queue.pop();
      if (total > distance_[i] + estimate(i)) continue;
      if (poll_ && ++settled_ % 4096 == 0) poll_();
      if (goal(i)) return i;
      for (const CutGraph::Arc& arc : graph_.arcs[i]) reach(arc.to, distance_[i] + arc.length, i);
    }
    return -1;
  }

  double distance(Index i) const { return stamp_[i] == now_ ? distance_[i] : kInfinity; }

  // Vertices from a source to node i.
  Loop path_to(Index i) const {
    Loop path;
    for (; i >= 0; i = parent_[i]) path.push_back(graph_.vertex[i]);
    std::reverse(path.begin(), path.end());
    return path;
  }

 private:
  const CutGraph& graph_;
  const Poll& poll_;
  std::vector<double> distance_;
  std::vector<Index> parent_, stamp_;
  Index now_ = 0, settled_ = 0;
};

double none(Index) { return 0.0; }

// The half-edges of a shortest path from the left border of the annulus to its right border.
std::vector<Index> path_across(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                               const std::vector<Index>& cut, const std::vector<char>& is_cut,
                               const Poll& poll) {
  const CutGraph annulus = cut_open(top, edge_length, is_cut);
  std::vector<Index> left;
  std::vector<char> is_right(annulus.size(), 0);
  for (const Index h : cut) {
    left.push_back(annulus.left(h));
    is_right[annulus.left(top.twin[h])] = 1;
  }
  PathSearch search(annulus, poll);
  const Index end = search.run(
      left, kInfinity, [&](Index i) { return is_right[i] != 0; }, none);
  const Loop path = search.path_to(end);
  std::vector<Index> halfedges;
  for (std::size_t k = 0; k + 1 < path.size(); ++k) {
    halfedges.push_back(find_halfedge(top, path[k], path[k + 1]));
  }
  return halfedges;
}

}  // namespace

Loop shortest_in_annulus(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                         const Loop& cut, const Poll& poll) {
  std::vector<char> is_cut(top.edges.rows(), 0);
  const std::vector<Index> border = loop_halfedges(top, cut);
  Loop shortest = cut;
  double best = 0.0;
  for (const Index h : border) {
    is_cut[top.edge[h]] = 1;
    best += edge_length[top.edge[h]];
  }
  const std::vector<Index> across = path_across(top, edge_length, border, is_cut, poll);
  for (const Index h : across) is_cut[top.edge[h]] = 1;

  const CutGraph disk = cut_open(top, edge_length, is_cut);
  const Index n = static_cast<Index>(across.size()) + 1;
  std::vector<Index> left(n), right(n);  // the copies of the vertices of `across`
  Vec arc = Vec::Zero(n);                // distance from its first vertex
  for (Index k = 0; k + 1 < n; ++k) {
    const Index h = across[k], back = top.twin[h];
    left[k] = disk.left(h);
    left[k + 1] = disk.left_head(h);
    right[k] = disk.left_head(back);
    right[k + 1] = disk.left(back);
    arc[k + 1] = arc[k] + edge_length[top.edge[h]];
  }
  // A search goes a little further than needed, since the length it finds spares other vertices.
  constexpr double kBeyond = 1.25;
  PathSearch estimate(disk, poll), search(disk, poll);
  estimate.run(
      right, kBeyond * best, [](Index) { return false; }, none);
  Vec bound(n);  // no loop through vertex k is shorter
  for (Index k = 0; k < n; ++k) bound[k] = estimate.distance(left[k]);
  Index k = 0;
  while (bound.minCoeff(&k) < best) {
    const double cutoff = kBeyond * best;
    const Index end = search.run(
        {left[k]}, cutoff, [&](Index i) { return i == right[k]; },
        [&](Index i) { return estimate.distance(i); });
    const double length = end < 0 ? cutoff : search.distance(end);
    if (length < best) {
      best = length;
      shortest = search.path_to(end);
      shortest.pop_back();
    }
    for (Index other = 0; other < n; ++other) {
      bound[other] = std::max(bound[other], length - 2.0 * std::abs(arc[other] - arc[k]));
    }
    bound[k] = kInfinity;
  }
  return shortest;
}

}  // namespace stretchmap::homology
