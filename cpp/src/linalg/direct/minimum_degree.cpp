#include "linalg/direct/minimum_degree.hpp"

#include <Eigen/OrderingMethods>
#include <algorithm>
#include <utility>

#include "linalg/direct/dense_front.hpp"

namespace stretchmap::linalg {

namespace {

// In flops: what an entry of a front takes to be cleared, filled and passed on, and a front itself.
constexpr double kEntry = 10.0, kFront = 1e4;

std::vector<Index> eliminated_in(Index n, const Index* start, const Index* col) {
  using Pattern = Eigen::SparseMatrix<float, Eigen::ColMajor, Index>;
  const std::vector<float> ones(static_cast<std::size_t>(start[n]), 1.0f);
  const Pattern graph = Eigen::Map<const Pattern>(n, n, start[n], start, col, ones.data());
  Eigen::AMDOrdering<Index>::PermutationType found;
  Eigen::AMDOrdering<Index>()(graph, found);
  return {found.indices().data(), found.indices().data() + n};
}

// Of unknowns in the order of their elimination: what the first is that each fills, and how many.
struct Elimination {
  std::vector<Index> parent;  // -1: none
  std::vector<Index> count;

  Elimination(const std::vector<Index>& order, const Index* start, const Index* col)
      : parent(order.size(), -1), count(order.size(), 0) {
    const auto n = static_cast<Index>(order.size());
    std::vector<Index> place(order.size()), mark(order.size(), -1);
    for (Index k = 0; k < n; ++k) place[order[k]] = k;
    for (Index k = 0; k < n; ++k) {
      mark[k] = k;
      for (Index e = start[order[k]]; e < start[order[k] + 1]; ++e)
        for (Index i = place[col[e]]; i < k && mark[i] != k; i = parent[i]) {
          if (parent[i] < 0) parent[i] = k;
          mark[i] = k;
          ++count[i];
        }
    }
  }
};

// Children before their parents; the trees' roots are those without one.
std::vector<Index> postorder(const std::vector<Index>& parent) {
  const auto n = static_cast<Index>(parent.size());
  std::vector<Index> child(parent.size(), -1), next(parent.size(), -1), order, open;
  for (Index k = n; k-- > 0;)
    if (parent[k] >= 0) next[k] = std::exchange(child[parent[k]], k);
  order.reserve(parent.size());
  for (Index root = 0; root < n; ++root) {
    if (parent[root] >= 0) continue;
    open.push_back(root);
    while (!open.empty()) {
      const Index k = open.back();
      if (child[k] >= 0) {
        open.push_back(std::exchange(child[k], next[child[k]]));
      } else {
        order.push_back(k);
        open.pop_back();
      }
    }
  }
  return order;
}

// Vertices that fill the same but for each other, and what becomes of them.
struct Group {
  std::vector<Index> vertices;  // in the order of their elimination
  std::vector<Index> children;
  Index border = 0;
  Index parent = -1;
};

double cost(const Group& group, Index own, Index width) {
  const double size = static_cast<double>(width) * (own + group.border);
  return front_flops(size, static_cast<double>(width) * own) + kEntry * size * size + kFront;
}

double cost(const Group& group, Index width) {
  return cost(group, static_cast<Index>(group.vertices.size()), width);
}

std::vector<Group> grouped(const std::vector<Index>& order, const Elimination& found) {
  std::vector<Group> groups;
  std::vector<Index> group_of(order.size());
  Index last = -1;
  for (const Index k : postorder(found.parent)) {
    const bool same =
        last >= 0 && found.parent[last] == k && found.count[last] == found.count[k] + 1;
    if (!same) groups.emplace_back();
    groups.back().vertices.push_back(order[k]);
    groups.back().border = found.count[k];
    groups.back().parent = found.parent[k];
    group_of[k] = static_cast<Index>(groups.size()) - 1;
    last = k;
  }
  for (Group& group : groups)
    if (group.parent >= 0) group.parent = group_of[group.parent];
  for (Index g = 0; g < static_cast<Index>(groups.size()); ++g)
    if (groups[g].parent >= 0) groups[groups[g].parent].children.push_back(g);
  return groups;
}

// Groups join their parents where a larger front is less work than two.
void merge(std::vector<Group>& groups, Index width) {
  for (Group& group : groups) {
    std::vector<Index> open = std::exchange(group.children, {});
    while (!open.empty()) {
      const Index c = open.back();
      open.pop_back();
      Group& child = groups[c];
      const auto own = static_cast<Index>(group.vertices.size() + child.vertices.size());
      if (cost(group, own, width) > cost(group, width) + cost(child, width)) {
        group.children.push_back(c);
        continue;
      }
      child.vertices.insert(child.vertices.end(), group.vertices.begin(), group.vertices.end());
      group.vertices = std::exchange(child.vertices, {});
      open.insert(open.end(), child.children.begin(), child.children.end());
      child.children.clear();
    }
  }
}

}  // namespace

MinimumDegree minimum_degree(Index n, const Index* start, const Index* col, Index width) {
  MinimumDegree result;
  Dissection& tree = result.tree;
  const std::vector<Index> order = eliminated_in(n, start, col);
  std::vector<Group> groups = grouped(order, Elimination(order, start, col));
  merge(groups, width);
  std::vector<Index> node_of(groups.size(), -1), roots;
  tree.order.reserve(order.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const Group& group = groups[g];
    if (group.vertices.empty()) continue;  // merged
    Dissection::Node node;
    for (const Index child : group.children) node.children.push_back(node_of[child]);
    node.first = static_cast<Index>(tree.order.size());
    tree.order.insert(tree.order.end(), group.vertices.begin(), group.vertices.end());
    node.last = static_cast<Index>(tree.order.size());
    node_of[g] = static_cast<Index>(tree.nodes.size());
    if (group.parent < 0) roots.push_back(node_of[g]);
    tree.nodes.push_back(std::move(node));
    const double own = static_cast<double>(width) * static_cast<double>(group.vertices.size());
    result.flops += front_flops(own + static_cast<double>(width) * group.border, own);
  }
  if (roots.size() != 1) {  // one root for all
    const auto end = static_cast<Index>(tree.order.size());
    tree.nodes.push_back({end, end, std::move(roots)});
  }
  return result;
}

}  // namespace stretchmap::linalg
