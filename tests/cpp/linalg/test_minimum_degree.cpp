// The order of least degree: that it is one, and that it serves where distances mislead.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "linalg/direct/dense_front.hpp"
#include "linalg/direct/minimum_degree.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"
#include "support/graph.hpp"

TEST_SUITE_BEGIN("linalg");

namespace {

using namespace stretchmap;

using tests::Graph;

linalg::MinimumDegree ordered(const Graph& graph, Index width) {
  return graph.apply([&](Index n, const Index* start, const Index* col) {
    return linalg::minimum_degree(n, start, col, width);
  });
}

// A ring, each vertex of which is joined to two more: few steps from anywhere to anywhere.
Graph wheel(Index n) {
  Graph graph(n + 2);
  for (Index v = 0; v < n; ++v) {
    graph.join(v, (v + 1) % n);
    graph.join(v, n);
    graph.join(v, n + 1);
  }
  return graph;
}

Graph scattered(Index n, unsigned seed) {
  Graph graph(n);
  std::mt19937 engine(seed);
  for (Index k = 0; k < n; ++k) graph.join(engine() % n, engine() % n);  // some by themselves
  return graph;
}

// What each node's elimination fills is eliminated by those above it alone; \return the flops.
double check_tree(const Graph& graph, const linalg::Dissection& tree, Index width) {
  std::vector<Index> place(graph.rows.size(), -1);
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
      const linalg::MinimumDegree found = ordered(graph, width);
      CHECK(check_tree(graph, found.tree, width) == doctest::Approx(found.flops));
    }
  }
  CHECK(ordered(Graph(0), 1).tree.nodes.size() == 1);
}

TEST_CASE("vertices are eliminated many at a time where that is less work") {
  Graph graph(60 * 60);
  graph.add_grid(0, 60, 60);
  const linalg::MinimumDegree narrow = ordered(graph, 1), wide = ordered(graph, 3);
  CHECK(check_tree(graph, narrow.tree, 1) == doctest::Approx(narrow.flops));
  CHECK(check_tree(graph, wide.tree, 3) == doctest::Approx(wide.flops));
  CHECK(8 * narrow.tree.nodes.size() < graph.rows.size());
  // The less a front costs beside its flops, the smaller it may be.
  CHECK(narrow.tree.nodes.size() < wide.tree.nodes.size());
}

TEST_CASE("where a few vertices are next to all others the order of least degree is taken") {
  const Graph graph = wheel(3000);
  const linalg::MinimumDegree found = ordered(graph, 1);
  CHECK(check_tree(graph, found.tree, 1) == doctest::Approx(found.flops));
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index v = 0; v < graph.size(); ++v)
    for (const Index w : graph.rows[v])
      entries.emplace_back(v, w, v == w ? 2.0 + double(graph.rows[v].size()) : -1.0);
  SparseMatrix matrix(graph.size(), graph.size());
  matrix.setFromTriplets(entries.begin(), entries.end());
  linalg::BlockLdlt<1> factor(matrix);
  CHECK(factor.flops() == doctest::Approx(found.flops));
  const linalg::Dissection other = graph.apply(linalg::dissect);
  CHECK(found.flops < 0.1 * check_tree(graph, other, 1));
  factor.factorize(matrix);
  const Vec right = Vec::LinSpaced(graph.size(), -1.0, 2.0);
  CHECK((matrix * factor.solve(right) - right).norm() < 1e-10 * right.norm());
}

TEST_SUITE_END();
