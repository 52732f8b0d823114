// The order of least degree: that it is one, and that it serves where distances mislead.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "linalg/direct/dense_front.hpp"
#include "linalg/direct/minimum_degree.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"

TEST_SUITE_BEGIN("linalg");

namespace {

using namespace stretchmap;

struct Graph {
  explicit Graph(Index n) : rows(n) {
    for (Index v = 0; v < n; ++v) rows[v].push_back(v);
  }
  void join(Index i, Index j) {
    rows[i].push_back(j);
    rows[j].push_back(i);
  }
  void finish() {
    for (std::vector<Index>& row : rows) {
      std::sort(row.begin(), row.end());
      row.erase(std::unique(row.begin(), row.end()), row.end());
      col.insert(col.end(), row.begin(), row.end());
      start.push_back(static_cast<Index>(col.size()));
    }
  }
  Index size() const { return static_cast<Index>(rows.size()); }
  linalg::MinimumDegree ordered(Index width) const {
    return linalg::minimum_degree(size(), start.data(), col.data(), width);
  }
  std::vector<std::vector<Index>> rows;
  std::vector<Index> start{0}, col;
};

// A ring, each vertex of which is joined to two more: few steps from anywhere to anywhere.
Graph wheel(Index n) {
  Graph graph(n + 2);
  for (Index v = 0; v < n; ++v) {
    graph.join(v, (v + 1) % n);
    graph.join(v, n);
    graph.join(v, n + 1);
  }
  graph.finish();
  return graph;
}

Graph scattered(Index n, unsigned seed) {
  Graph graph(n);
  std::mt19937 engine(seed);
  for (Index k = 0; k < n; ++k) graph.join(engine() % n, engine() % n);  // some by themselves
  graph.finish();
  return graph;
}

// What each node's elimination fills is eliminated by those above it alone; \return the flops.
double check_tree(const Graph& graph, const linalg::Dissection& tree, Index width) {
  std::vector<Index> place(graph.rows.size(), -1), node_of(graph.rows.size());
  REQUIRE(tree.order.size() == graph.rows.size());
  for (std::size_t k = 0; k < tree.order.size(); ++k) place[tree.order[k]] = Index(k);
  CHECK(std::count(place.begin(), place.end(), -1) == 0);
  const auto n_nodes = static_cast<Index>(tree.nodes.size());
  std::vector<std::vector<Index>> border(tree.nodes.size());
  std::vector<Index> parents(tree.nodes.size(), 0);
  Index before = 0;
  double flops = 0.0;
  for (Index f = 0; f < n_nodes; ++f) {
    const linalg::Dissection::Node& node = tree.nodes[f];
    CHECK(node.first == before);
    before = node.last;
    for (Index k = node.first; k < node.last; ++k)
      for (const Index w : graph.rows[tree.order[k]]) border[f].push_back(place[w]);
    for (const Index child : node.children) {
      CHECK(child < f);
      ++parents[child];
      // What a child fills is not eliminated in between.
      const auto early = [&](Index k) { return k < node.first; };
      CHECK(std::none_of(border[child].begin(), border[child].end(), early));
      border[f].insert(border[f].end(), border[child].begin(), border[child].end());
    }
    const auto behind = [&](Index k) { return k >= node.last; };
    std::sort(border[f].begin(), border[f].end());
    border[f].erase(std::unique(border[f].begin(), border[f].end()), border[f].end());
    border[f].erase(border[f].begin(), std::find_if(border[f].begin(), border[f].end(), behind));
    const double own = width * (node.last - node.first);
    flops += linalg::front_flops(own + width * double(border[f].size()), own);
  }
  CHECK(before == graph.size());
  CHECK(parents.back() == 0);
  for (Index f = 0; f + 1 < n_nodes; ++f) CHECK(parents[f] == 1);
  CHECK(border.back().empty());
  return flops;
}

}  // namespace

TEST_CASE("eliminations of least degree form one tree, and their work is counted") {
  for (const Index width : {1, 3}) {
    for (unsigned seed = 0; seed < 20; ++seed) {
      const Graph graph = scattered(1 + 13 * seed, seed);
      const linalg::MinimumDegree found = graph.ordered(width);
      CHECK(check_tree(graph, found.tree, width) == doctest::Approx(found.flops));
    }
  }
  CHECK(Graph(0).ordered(1).tree.nodes.size() == 1);
}

TEST_CASE("vertices are eliminated many at a time where that is less work") {
  const Index side = 60;
  Graph graph(side * side);
  for (Index v = 0; v < graph.size(); ++v) {
    if ((v + 1) % side) graph.join(v, v + 1);
    if (v + side < graph.size()) graph.join(v, v + side);
  }
  graph.finish();
  const linalg::MinimumDegree narrow = graph.ordered(1), wide = graph.ordered(3);
  CHECK(check_tree(graph, narrow.tree, 1) == doctest::Approx(narrow.flops));
  CHECK(check_tree(graph, wide.tree, 3) == doctest::Approx(wide.flops));
  CHECK(8 * narrow.tree.nodes.size() < graph.rows.size());
  // The less a front costs beside its flops, the smaller it may be.
  CHECK(narrow.tree.nodes.size() < wide.tree.nodes.size());
}

TEST_CASE("where a few vertices are next to all others the order of least degree is taken") {
  const Graph graph = wheel(3000);
  const linalg::MinimumDegree found = graph.ordered(1);
  CHECK(check_tree(graph, found.tree, 1) == doctest::Approx(found.flops));
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index v = 0; v < graph.size(); ++v)
    for (const Index w : graph.rows[v])
      entries.emplace_back(v, w, v == w ? 2.0 + double(graph.rows[v].size()) : -1.0);
  SparseMatrix matrix(graph.size(), graph.size());
  matrix.setFromTriplets(entries.begin(), entries.end());
  linalg::BlockLdlt<1> factor(matrix);
  CHECK(factor.flops() == doctest::Approx(found.flops));
  const linalg::Dissection other =
      linalg::dissect(graph.size(), graph.start.data(), graph.col.data());
  CHECK(found.flops < 0.1 * check_tree(graph, other, 1));
  factor.factorize(matrix);
  const Vec right = Vec::LinSpaced(graph.size(), -1.0, 2.0);
  CHECK((matrix * factor.solve(right) - right).norm() < 1e-10 * right.norm());
}

TEST_SUITE_END();
