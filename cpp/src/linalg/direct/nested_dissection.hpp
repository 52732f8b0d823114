// Nested dissection: a small set of vertices halves the graph, and each half again. Of a surface's
// factor it leaves O(n log n) entries, in large dense blocks.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

struct Dissection {
  // A separator, or a piece too small to be divided: consecutive places [first, last).
  struct Node {
    Index first = 0, last = 0;
    std::vector<Index> children;  // before the node; not more than two
  };
  std::vector<Index> order;  // order[place] = vertex
  std::vector<Node> nodes;   // children before their parents, the last the root
};

// \param start, col compressed rows of a symmetric pattern of n vertices.
Dissection dissect(Index n, const Index* start, const Index* col);

}  // namespace stretchmap::linalg
