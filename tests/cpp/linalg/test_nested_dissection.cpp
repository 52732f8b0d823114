// Separators: that they separate, and that they lie where a graph is thin.
#include <doctest/doctest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "linalg/direct/nested_dissection.hpp"
#include "support/graph.hpp"

TEST_SUITE_BEGIN("linalg");

namespace {

using namespace stretchmap;

using tests::Graph;

linalg::Dissection dissected(const Graph& graph) { return graph.apply(linalg::dissect); }

// First place of the subtree of a node.
Index begin_of(const linalg::Dissection& found, Index node) {
  Index first = found.nodes[node].first;
  for (const Index child : found.nodes[node].children)
    first = std::min(first, begin_of(found, child));
  return first;
}

}  // namespace

TEST_CASE("no edge joins the two sides of a separator") {
  // Pieces of the second are dissected by themselves.
  for (const auto& [height, width] : {std::pair<Index, Index>{30, 40}, {90, 70}}) {
    Graph graph(height * width);
    graph.add_grid(0, height, width);
    const linalg::Dissection found = dissected(graph);
    REQUIRE(found.order.size() == graph.rows.size());
    std::vector<Index> place(graph.rows.size(), -1);
    for (std::size_t k = 0; k < found.order.size(); ++k) place[found.order[k]] = Index(k);
    CHECK(std::count(place.begin(), place.end(), -1) == 0);
    Index all = 0, separated = 0, before = 0;
    for (std::size_t n = 0; n < found.nodes.size(); ++n) {
      const linalg::Dissection::Node& node = found.nodes[n];
      CHECK(node.first == before);  // one after the other, children before their parents
      before = node.last;
      all += node.last - node.first;
      for (const Index child : node.children) CHECK(child < Index(n));
      if (node.children.size() < 2) continue;
      ++separated;
      const Index first = begin_of(found, node.children[0]);
      const Index middle = begin_of(found, node.children[1]);
      for (Index k = first; k < middle; ++k)
        for (const Index w : graph.rows[found.order[k]])
          CHECK_FALSE((place[w] >= middle && place[w] < node.first));
    }
    CHECK(all == height * width);
    CHECK(separated > 10);
  }
}

TEST_CASE("a graph is cut where it is thin, not in the middle") {
  // Two grids, one of them half as large again, joined by a bridge of three edges.
  const Index width = 20, small = 20 * width, large = 30 * width;
  Graph graph(small + large);
  graph.add_grid(0, 20, width);
  graph.add_grid(small, 30, width);
  for (Index c = 0; c < 3; ++c) graph.join(small - width + c, small + c);
  const linalg::Dissection found = dissected(graph);
  CHECK(found.nodes.back().last - found.nodes.back().first <= 3);
}

TEST_SUITE_END();
