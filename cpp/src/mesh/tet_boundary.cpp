#include "stretchmap/mesh/tet_boundary.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/mesh/facets.hpp"

namespace stretchmap::mesh {

IndexVec tet_neighbors(const TetsRef& tets, Index n_vertices, const Poll& poll) {
  const FacetGroups groups = group_half_faces(tets, n_vertices, {}, poll);
  IndexVec twin(4 * tets.rows());
  for_rows(groups.size(), [&](Index g) {
    const Index* h = groups.order.data() + groups.start[g];
    const bool two = groups.start[g + 1] - groups.start[g] == 2;
    twin[h[0]] = two ? h[1] : -1;
    if (two) twin[h[1]] = h[0];
  });
  for (Index g = 0; g < groups.size(); ++g) {
    const Index first = groups.start[g], last = groups.start[g + 1];
    if (last - first > 2) {
      const auto f = half_face(tets, groups.order[first]);
      std::vector<Index> at_fault;
      for (Index p = first; p < last; ++p) at_fault.push_back(groups.order[p] / 4);
      throw Error("NonManifoldError",
                  "face (" + std::to_string(f[0]) + ", " + std::to_string(f[1]) + ", " +
                      std::to_string(f[2]) + ") belongs to " + std::to_string(last - first) +
                      " tets; at most two may meet at a face",
                  at_fault);
    }
  }
  return twin;
}

TetBoundary tet_boundary(const TetsRef& tets, Index n_vertices, const Poll& poll) {
  const IndexVec twin = tet_neighbors(tets, n_vertices, poll);
  TetBoundary boundary;
  const Index n_faces = static_cast<Index>((twin.array() < 0).count());
  boundary.faces.resize(n_faces, 3);
  boundary.tets.resize(n_faces);
  boundary.index.setConstant(n_vertices, -1);
  for (Index h = 0, f = 0; h < twin.size(); ++h) {
    if (twin[h] >= 0) continue;
    boundary.faces.row(f) = half_face(tets, h);
    boundary.tets[f] = h / 4;
    for (int k = 0; k < 3; ++k) boundary.index[boundary.faces(f, k)] = 0;
    ++f;
  }
  boundary.vertices.resize((boundary.index.array() >= 0).count());
  for (Index i = 0, b = 0; i < n_vertices; ++i) {
    if (boundary.index[i] < 0) continue;
    boundary.vertices[b] = i;
    boundary.index[i] = b++;
  }
  for (Index f = 0; f < n_faces; ++f) {
    for (int k = 0; k < 3; ++k) boundary.faces(f, k) = boundary.index[boundary.faces(f, k)];
  }
  return boundary;
}

Edges tet_edges(const TetsRef& tets, Index n_vertices, const Poll& poll) {
  const FacetGroups groups = group_tet_edges(tets, n_vertices, {}, poll);
  Edges edges(groups.size(), 2);
  for (Index g = 0; g < groups.size(); ++g) {
    const Index h = groups.order[groups.start[g]];
    const Index a = tets(h / 6, kTetEdge[h % 6][0]), b = tets(h / 6, kTetEdge[h % 6][1]);
    edges.row(g) << std::min(a, b), std::max(a, b);
  }
  return edges;
}

}  // namespace stretchmap::mesh
