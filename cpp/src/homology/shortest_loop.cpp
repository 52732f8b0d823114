#include "stretchmap/homology/shortest_loop.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "homology/annulus_loop.hpp"
#include "homology/cover_search.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap::homology {
namespace {

bool is_simple(Loop loop) {
  std::sort(loop.begin(), loop.end());
  return std::adjacent_find(loop.begin(), loop.end()) == loop.end();
}

// A loop shortest through its first vertex may run to and fro between that vertex and another
// through which it is shortest, too: this is that other loop.
Loop without_stem(const Loop& loop) {
  std::size_t first = 0, end = loop.size();
  while (end - first > 2 && loop[first + 1] == loop[end - 1]) ++first, --end;
  return {loop.begin() + first, loop.begin() + end};
}

// Searches from vertices of `crossing` until no other can lie on a shorter loop.
Loop shortest_through(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                      const Loop& crossing, CoverSearch& search) {
  const Index n = static_cast<Index>(crossing.size());
  Vec arc(n + 1);  // distance along `crossing` from its first vertex
  arc[0] = 0.0;
  const std::vector<Index> along = loop_halfedges(top, crossing);
  for (Index k = 0; k < n; ++k) arc[k + 1] = arc[k] + edge_length[top.edge[along[k]]];

  Vec bound = Vec::Zero(n);  // no loop of the class through crossing[k] is shorter
  Index source = 0;
  while (!search.is_exhausted() && bound.minCoeff(&source) < search.best()) {
    const double length = search.search_from(crossing[source], 1.25 * search.best());
    for (Index k = 0; k < n; ++k) {
      const double apart = std::abs(arc[k] - arc[source]);
      bound[k] = std::max(bound[k], length - 2.0 * std::min(apart, arc[n] - apart));
    }
    bound[source] = std::numeric_limits<double>::infinity();
  }
  return search.loop();
}

}  // namespace

Loop shortest_loop(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                   const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target,
                   const Loop& crossing, const Poll& poll, double limit,
                   std::int64_t most_settled) {
  CoverSearch search(top, edge_length, forms, target, poll, limit, most_settled);
  const bool bounded = limit < std::numeric_limits<double>::infinity();
  Loop loop;
  if (forms.rows() == 2 && !bounded) {
    search.search_from(crossing[0], std::numeric_limits<double>::infinity());
    loop = without_stem(search.loop());
    if (is_simple(loop)) {
      loop = shortest_in_annulus(top, edge_length, loop, poll);
    } else {
      loop.clear();
    }
  }
  if (loop.empty()) loop = shortest_through(top, edge_length, crossing, search);
  if (search.is_exhausted()) return {};
  if (loop.empty() && bounded) return loop;
  if (loop.empty()) {
    throw Error("SolverError", "no loop of the class crosses the loop given");
  }
  if (periods(top, forms, loop) != target) std::reverse(loop.begin() + 1, loop.end());
  return loop;
}

}  // namespace stretchmap::homology
