#include "stretchmap/mesh/surface_topology.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/mesh/facets.hpp"

namespace stretchmap::mesh {
namespace {

std::string name(Index i, Index j) {
  return "edge (" + std::to_string(i) + ", " + std::to_string(j) + ")";
}

// Makes twins of the two half-edges of edge g.
void pair_up(const FacetGroups& groups, Index g, SurfaceTopology& top) {
  const Index first = groups.start[g], members = groups.start[g + 1] - first;
  const Index a = groups.order[first];
  const Index i = top.edges(g, 0), j = top.edges(g, 1);
  if (members > 2) {
    std::vector<Index> at_fault;
    for (Index p = first; p < first + members; ++p) at_fault.push_back(groups.order[p] / 3);
    throw Error(
        "NonManifoldError",
        name(i, j) + " has " + std::to_string(members) + " faces; at most two may meet at an edge",
        at_fault);
  }
  if (members < 2) return;
  const Index b = groups.order[first + 1];
  if (top.tail(a) == top.tail(b)) {
    throw Error("OrientationError",
                "faces " + std::to_string(a / 3) + " and " + std::to_string(b / 3) + " run along " +
                    name(i, j) +
                    " in the same direction; orient the faces consistently (orient=True)",
                {a / 3, b / 3});
  }
  top.twin[a] = b;
  top.twin[b] = a;
}

}  // namespace

SurfaceTopology surface_topology(const FacesRef& faces, Index n_vertices) {
  SurfaceTopology top;
  top.n_vertices = n_vertices;
  top.faces = faces;
  const Index n_half = static_cast<Index>(3 * faces.rows());
  const FacetGroups groups = group_half_edges(faces, n_vertices);

  top.twin.setConstant(n_half, -1);
  top.edge.resize(n_half);
  top.edges.resize(groups.size(), 2);
  top.edge_halfedge.resize(groups.size());
  for (Index g = 0; g < groups.size(); ++g) {
    const Index a = groups.order[groups.start[g]];
    top.edges.row(g) << std::min(top.tail(a), top.head(a)), std::max(top.tail(a), top.head(a));
    pair_up(groups, g, top);
    for (Index p = groups.start[g]; p < groups.start[g + 1]; ++p) top.edge[groups.order[p]] = g;
    const Index b = top.twin[a];
    top.edge_halfedge[g] = b < 0 || top.tail(a) < top.head(a) ? a : b;
  }
  top.vertex_halfedge.setConstant(n_vertices, -1);
  for (Index h = n_half - 1; h >= 0; --h) top.vertex_halfedge[top.tail(h)] = h;
  return top;
}

}  // namespace stretchmap::mesh
