#include "stretchmap/mesh/longest_first.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace stretchmap::mesh {

IndexVec longest_first(const PointsRef& points, const EdgesRef& edges) {
  constexpr double kSteps = 32;    // within a factor of two
  constexpr double kOffset = 0.3;  // no step begins where lengths of regular grids are
  const Index n = static_cast<Index>(edges.rows());
  Vec length(n);
  for (Index i = 0; i < n; ++i) {
    length[i] = (points.row(edges(i, 0)) - points.row(edges(i, 1))).stableNorm();
  }
  const double longest = n > 0 ? length.maxCoeff() : 0.0;
  std::vector<std::pair<double, Index>> order;
  order.reserve(n);
  for (Index i = 0; i < n; ++i) {
    const double step = std::floor(kSteps * std::log2(longest / length[i]) + kOffset);
    const bool any = step >= 0.0;  // not where there is no length at all
    order.emplace_back(any ? step : std::numeric_limits<double>::infinity(), i);
  }
  std::sort(order.begin(), order.end());
  IndexVec sorted(n);
  for (Index k = 0; k < n; ++k) sorted[k] = order[k].second;
  return sorted;
}

}  // namespace stretchmap::mesh
