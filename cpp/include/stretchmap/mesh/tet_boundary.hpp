// Boundary of a tet mesh, with maps both ways.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

struct TetBoundary {
  Faces faces;        // (m, 3) in the surface's own vertex numbering, outward
  IndexVec vertices;  // (nb) surface vertex -> solid vertex, ascending
  IndexVec index;     // (n) solid vertex -> surface vertex, -1 inside
  IndexVec tets;      // (m) boundary face -> the tet it belongs to
};

// Faces are ordered by tet, then by the corner they lie opposite to.
// \pre indices in [0, n_vertices).
// \throws Error "NonManifoldError" for a face shared by more than two tets (ids: the tets).
TetBoundary tet_boundary(const TetsRef& tets, Index n_vertices, const Poll& poll = {});

// (4 k) the half-face on the other side of each half-face, -1 on the boundary.
// \throws as above.
IndexVec tet_neighbors(const TetsRef& tets, Index n_vertices, const Poll& poll = {});

// \return (e, 2) edges of a tet mesh, lower id first, in lexicographic order.
Edges tet_edges(const TetsRef& tets, Index n_vertices, const Poll& poll = {});

}  // namespace stretchmap::mesh
