#include "stretchmap/mesh/surface_topology.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "stretchmap/base/errors.hpp"

namespace stretchmap {

SurfaceTopology surface_topology(const FacesRef& faces, Index n_vertices) {
  SurfaceTopology top;
  top.n_vertices = n_vertices;
  top.faces = faces;
  const Index n_half = static_cast<Index>(3 * faces.rows());

  // Counting sort by the lower id, then a short sort inside each bucket: lexicographic edges.
  std::vector<Index> start(static_cast<std::size_t>(n_vertices) + 1, 0);
  for (Index h = 0; h < n_half; ++h) ++start[std::min(top.tail(h), top.head(h)) + 1];
  for (Index i = 0; i < n_vertices; ++i) start[i + 1] += start[i];
  std::vector<Index> order(n_half), cursor(start.begin(), start.end() - 1);
  for (Index h = 0; h < n_half; ++h) order[cursor[std::min(top.tail(h), top.head(h))]++] = h;
  const auto higher = [&](Index h) { return std::max(top.tail(h), top.head(h)); };
  for (Index i = 0; i < n_vertices; ++i) {
    std::sort(order.begin() + start[i], order.begin() + start[i + 1], [&](Index a, Index b) {
      return higher(a) != higher(b) ? higher(a) < higher(b) : a < b;
    });
  }

  top.twin.setConstant(n_half, -1);
  top.edge.resize(n_half);
  std::vector<std::array<Index, 2>> edges;
  std::vector<Index> edge_halfedge;
  edges.reserve(n_half / 2);
  edge_halfedge.reserve(n_half / 2);
  for (Index i = 0; i < n_vertices; ++i) {
    for (Index p = start[i]; p < start[i + 1];) {
      Index q = p;
      while (q < start[i + 1] && higher(order[q]) == higher(order[p])) ++q;
      const Index j = higher(order[p]);
      if (q - p > 2) {
        std::vector<Index> at_fault;
        for (Index k = p; k < q; ++k) at_fault.push_back(order[k] / 3);
        throw Error("NonManifoldError",
                    "edge (" + std::to_string(i) + ", " + std::to_string(j) + ") has " +
                        std::to_string(q - p) + " faces; at most two may meet at an edge",
                    at_fault);
      }
      const Index a = order[p];
      const Index b = q - p == 2 ? order[p + 1] : -1;
      const Index id = static_cast<Index>(edges.size());
      top.edge[a] = id;
      if (b >= 0) {
        if (top.tail(a) == top.tail(b)) {
          throw Error("OrientationError",
                      "faces " + std::to_string(a / 3) + " and " + std::to_string(b / 3) +
                          " run along edge (" + std::to_string(i) + ", " + std::to_string(j) +
                          ") in the same direction; orient the faces consistently (orient=True)",
                      {a / 3, b / 3});
        }
        top.edge[b] = id;
        top.twin[a] = b;
        top.twin[b] = a;
      }
      edges.push_back({i, j});
      edge_halfedge.push_back(b < 0 || top.tail(a) == i ? a : b);
      p = q;
    }
  }
  top.edges.resize(static_cast<Index>(edges.size()), 2);
  for (std::size_t e = 0; e < edges.size(); ++e) top.edges.row(e) << edges[e][0], edges[e][1];
  top.edge_halfedge = Eigen::Map<IndexVec>(edge_halfedge.data(), edge_halfedge.size());
  top.vertex_halfedge.setConstant(n_vertices, -1);
  for (Index h = n_half - 1; h >= 0; --h) top.vertex_halfedge[top.tail(h)] = h;
  return top;
}

}  // namespace stretchmap
