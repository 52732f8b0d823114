// Union-find whose roots are the lowest members, so results do not depend on the order of unions.
#pragma once

#include <utility>
#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

class DisjointSets {
 public:
  explicit DisjointSets(Index n) : parent_(n) {
    for (Index i = 0; i < n; ++i) parent_[i] = i;
  }
  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(Index a, Index b) {
    a = find(a);
    b = find(b);
    if (b < a) std::swap(a, b);
    parent_[b] = a;
  }
  // (n) what find says of each: parents are lower, and so have their roots by then.
  std::vector<Index> roots() const {
    std::vector<Index> root = parent_;
    for (Index& parent : root) parent = root[parent];
    return root;
  }

 private:
  std::vector<Index> parent_;
};

// Connected components of elements (rows of vertex ids): two that share a vertex belong together.
struct Components {
  Index count = 0;
  IndexVec element;  // (m) component of each element, numbered by lowest element; -1 where skipped
  IndexVec vertex;   // (n) component of each vertex, -1 where no element uses it
};

template <class Elements>
Components components(const Elements& elements, Index n_vertices, const std::vector<char>& skip) {
  DisjointSets sets(n_vertices);
  for (Index e = 0; e < elements.rows(); ++e) {
    if (!skip.empty() && skip[e]) continue;
    for (Index k = 1; k < elements.cols(); ++k) sets.unite(elements(e, 0), elements(e, k));
  }
  const std::vector<Index> root = sets.roots();
  const Index m = static_cast<Index>(elements.rows());
  Components result;
  result.element.resize(m);
  for_rows(m, [&](Index e) {
    result.element[e] = !skip.empty() && skip[e] ? -1 : root[elements(e, 0)];
  });
  IndexVec number = IndexVec::Constant(n_vertices, -1);  // of each root
  for (Index& component : result.element) {
    if (component < 0) continue;
    if (number[component] < 0) number[component] = result.count++;
    component = number[component];
  }
  result.vertex.resize(n_vertices);
  for_rows(n_vertices, [&](Index i) { result.vertex[i] = number[root[i]]; });
  return result;
}

}  // namespace stretchmap::mesh
