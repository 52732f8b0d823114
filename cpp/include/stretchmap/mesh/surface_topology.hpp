// Half-edges and edges of a triangle mesh.
//
// Half-edge 3 f + k runs from faces(f, k) to faces(f, (k + 1) % 3) and has face f on its left.
// Edges are numbered in lexicographic order of (lower id, higher id) and oriented from the lower to
// the higher id, so a 1-form is one number per edge and its value along a half-edge is that number
// times sign(h).
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

struct SurfaceTopology {
  Index n_vertices = 0;
  Faces faces;               // (m, 3)
  IndexVec twin;             // (3m) opposite half-edge, -1 on a border
  IndexVec edge;             // (3m) edge of each half-edge
  Edges edges;               // (e, 2) lower id first
  IndexVec edge_halfedge;    // (e) the half-edge from the lower to the higher id; if the border
                             //     leaves only the other one, that one
  IndexVec vertex_halfedge;  // (n) an outgoing half-edge, -1 for an unreferenced vertex

  Index tail(Index h) const { return faces(h / 3, h % 3); }
  Index head(Index h) const { return faces(h / 3, (h + 1) % 3); }
  static Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
  static Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }
  // The half-edge from the same tail that follows clockwise; -1 on a border.
  Index turned(Index h) const { return twin[prev(h)]; }
  // +1 when the half-edge runs along its edge's orientation, else -1.
  double sign(Index h) const { return tail(h) < head(h) ? 1.0 : -1.0; }

  // visit(h) for the half-edges from a vertex that lies on no border.
  template <class Visit>
  void each_outgoing(Index i, const Visit& visit) const {
    Index h = vertex_halfedge[i];
    do {
      visit(h);
      h = turned(h);
    } while (h != vertex_halfedge[i]);
  }
};

// \pre indices in [0, n_vertices), no face repeats a vertex.
// \throws Error "NonManifoldError" for an edge with more than two faces,
//         Error "OrientationError" for two faces that run along an edge in the same direction.
SurfaceTopology surface_topology(const FacesRef& faces, Index n_vertices);

}  // namespace stretchmap::mesh
