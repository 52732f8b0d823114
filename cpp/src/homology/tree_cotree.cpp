#include "stretchmap/homology/tree_cotree.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "homology/shortest_paths.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap::homology {
namespace {

ShortestPaths shortest_path_tree(const mesh::SurfaceTopology& top, const VecRef& edge_length) {
  ShortestPaths tree(top, edge_length);
  tree.grow({0}, std::numeric_limits<double>::infinity(), [](Index) { return false; });
  for (Index i = 0; i < top.n_vertices; ++i) {
    if (!tree.reached(i)) {
      throw Error("ConnectivityError",
                  "vertex " + std::to_string(i) +
                      " is not joined to vertex 0: the surface has more than one component, or a "
                      "vertex that no face uses; keep one component",
                  {i});
    }
  }
  return tree;
}

Index find_root(std::vector<Index>& leader, Index f) {
  while (leader[f] != f) f = leader[f] = leader[leader[f]];
  return f;
}

// Kruskal on the dual graph, longest closing loop first. Marks the edges that the cotree crosses
// and returns those that neither tree uses, shortest closing loop first.
std::vector<Index> grow_cotree(const mesh::SurfaceTopology& top, const VecRef& length,
                               const ShortestPaths& tree, std::vector<char>& crossed) {
  const Index n_edges = static_cast<Index>(top.edges.rows());
  std::vector<char> in_tree(n_edges, 0);
  for (Index i = 0; i < top.n_vertices; ++i) {
    if (tree.entered(i) >= 0) in_tree[top.edge[tree.entered(i)]] = 1;
  }
  std::vector<std::pair<double, Index>> order;
  order.reserve(n_edges - top.n_vertices + 1);
  for (Index e = 0; e < n_edges; ++e) {
    if (in_tree[e]) continue;
    order.emplace_back(tree.distance(top.edges(e, 0)) + tree.distance(top.edges(e, 1)) + length[e],
                       e);
  }
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second < b.second;
  });
  std::vector<Index> leader(top.faces.rows());
  std::iota(leader.begin(), leader.end(), 0);
  crossed.assign(n_edges, 0);
  std::vector<Index> left_over;
  for (const auto& [weight, e] : order) {
    const Index h = top.edge_halfedge[e];
    const Index f = find_root(leader, h / 3);
    const Index g = find_root(leader, top.twin[h] / 3);
    if (f == g) {
      left_over.push_back(e);
    } else {
      leader[f] = g;
      crossed[e] = 1;
    }
  }
  std::reverse(left_over.begin(), left_over.end());
  return left_over;
}

// For each face the half-edge of that face across which its dual parent lies, -1 at the root.
std::vector<Index> dual_parents(const mesh::SurfaceTopology& top,
                                const std::vector<char>& crossed) {
  std::vector<Index> parent(top.faces.rows(), -2), queue{0};
  parent[0] = -1;
  for (std::size_t at = 0; at < queue.size(); ++at) {
    for (Index h = 3 * queue[at]; h < 3 * queue[at] + 3; ++h) {
      const Index other = top.twin[h];
      if (!crossed[top.edge[h]] || parent[other / 3] != -2) continue;
      parent[other / 3] = other;
      queue.push_back(other / 3);
    }
  }
  return parent;
}

}  // namespace

HomologyGenerators tree_cotree(const mesh::SurfaceTopology& top, const VecRef& edge_length) {
  const ShortestPaths tree = shortest_path_tree(top, edge_length);
  std::vector<char> crossed;
  const std::vector<Index> left_over = grow_cotree(top, edge_length, tree, crossed);
  const std::vector<Index> parent = dual_parents(top, crossed);

  HomologyGenerators result;
  result.forms.setZero(left_over.size(), top.edges.rows());
  for (std::size_t i = 0; i < left_over.size(); ++i) {
    const Index h = top.edge_halfedge[left_over[i]];
    result.loops.push_back(tree.loop_closed_by(h));
    // The dual loop crosses h from left to right and returns through the cotree. A half-edge
    // crossed from left to right counts +1; the parts common to both tree paths cancel.
    auto form = result.forms.row(i);
    const auto cross = [&](Index k, Index sign) {
      form[top.edge[k]] += top.sign(k) > 0 ? sign : -sign;
    };
    cross(h, 1);
    for (Index f = top.twin[h] / 3; parent[f] >= 0; f = top.twin[parent[f]] / 3) {
      cross(parent[f], 1);
    }
    for (Index f = h / 3; parent[f] >= 0; f = top.twin[parent[f]] / 3) cross(parent[f], -1);
  }
  return result;
}

Index find_halfedge(const mesh::SurfaceTopology& top, Index i, Index j) {
  const Index first = top.vertex_halfedge[i];
  Index h = first;
  do {
    if (top.head(h) == j) return h;
    h = top.turned(h);
  } while (h != first);
  return -1;
}

std::vector<Index> loop_halfedges(const mesh::SurfaceTopology& top, const Loop& loop) {
  std::vector<Index> path(loop.size());
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const Index next = loop[(k + 1) % loop.size()];
    path[k] = find_halfedge(top, loop[k], next);
    if (path[k] < 0) {
      throw Error("ArrayError",
                  "no edge joins the consecutive loop vertices " + std::to_string(loop[k]) +
                      " and " + std::to_string(next),
                  {loop[k], next});
    }
  }
  return path;
}

IndexVec periods(const mesh::SurfaceTopology& top, const Eigen::Ref<const IndexRows>& forms,
                 const Loop& loop) {
  IndexVec sum = IndexVec::Zero(forms.rows());
  for (const Index h : loop_halfedges(top, loop)) {
    sum += forms.col(top.edge[h]) * (top.sign(h) > 0 ? 1 : -1);
  }
  return sum;
}

Rows wedge_matrix(const mesh::SurfaceTopology& top, const RowsRef& forms) {
  constexpr Index kBlock = 256;  // faces whose products are added by one product of matrices
  const Index k = static_cast<Index>(forms.rows()), m = static_cast<Index>(top.faces.rows());
  Rows half = Rows::Zero(k, k), first(k, kBlock), second(k, kBlock);
  for (Index begin = 0; begin < m; begin += kBlock) {
    const Index n = std::min(kBlock, m - begin);
    for (Index f = 0; f < n; ++f) {
      const Index h = 3 * (begin + f);
      first.col(f) = forms.col(top.edge[h]) * (0.5 * top.sign(h));
      second.col(f) = forms.col(top.edge[h + 1]) * top.sign(h + 1);
    }
    half += first.leftCols(n) * second.leftCols(n).transpose();
  }
  return half - half.transpose();
}

}  // namespace stretchmap::homology
