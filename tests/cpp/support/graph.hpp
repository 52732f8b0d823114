// Graphs for tests of orders of elimination.
#pragma once

#include <algorithm>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::tests {

// Vertices that are joined, each with itself to begin with.
struct Graph {
  explicit Graph(Index n) : rows(n) {
    for (Index v = 0; v < n; ++v) rows[v].push_back(v);
  }
  Index size() const { return static_cast<Index>(rows.size()); }
  void join(Index i, Index j) {
    rows[i].push_back(j);
    rows[j].push_back(i);
  }
  // Vertices first, first + 1, ... as a grid, row by row.
  void add_grid(Index first, Index height, Index width) {
    for (Index r = 0; r < height; ++r)
      for (Index c = 0; c < width; ++c) {
        const Index v = first + r * width + c;
        if (c + 1 < width) join(v, v + 1);
        if (r + 1 < height) join(v, v + width);
      }
  }
  // f(n, start, col) of its compressed rows.
  template <class Function>
  auto apply(const Function& f) const {
    std::vector<Index> start{0}, col;
    for (std::vector<Index> row : rows) {
      std::sort(row.begin(), row.end());
      row.erase(std::unique(row.begin(), row.end()), row.end());
      col.insert(col.end(), row.begin(), row.end());
      start.push_back(static_cast<Index>(col.size()));
    }
    return f(size(), start.data(), col.data());
  }

  std::vector<std::vector<Index>> rows;
};

}  // namespace stretchmap::tests
