// Splitting what a prescribed boundary would freeze.
//
// An interior edge or face whose vertices all lie on the boundary is placed by the boundary map
// alone: nothing inside can repair a flip there. Every such edge gets a vertex at its midpoint, and
// every such face that has no such edge (it cuts off a corner of the solid) one at its centroid.
// Added vertices are inside, so nothing new is overconstrained, and afterwards every tet has at
// most one face, and never all four vertices, on the boundary.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

struct OverconstrainedElements {
  Edges edges;    // (a, 2) interior edges between boundary vertices, lower id first, in
                  //     lexicographic order
  Faces faces;    // (b, 3) interior faces between boundary vertices and boundary edges
  IndexVec tets;  // tets with such an edge or face, ascending
};

struct Refinement {
  Points points;        // (n + a + b, 3) input vertices, midpoints of the overconstrained edges,
                        //     centroids of the overconstrained faces
  Tets tets;            // (k', 4) in the order of their parents
  IndexVec parent_tet;  // (k') the input tet each lies in
  OverconstrainedElements split;
};

// \throws Error "NonManifoldError" for a face shared by more than two tets, "DegenerateError" for
//         tets that repeat a vertex; ids: the tets.
OverconstrainedElements overconstrained_elements(const TetsRef& tets, Index n_vertices,
                                                 const Poll& poll = {});

// Of edges with a tet in common the longest is halved first, with the vertices where they are
// `seen`. Orientation and total volume are kept. A tet that is its own component, with all its
// faces on the boundary, has nothing to split and stays. \throws as above.
Refinement refine_overconstrained(const PointsRef& points, const TetsRef& tets,
                                  const PointsRef& seen, const Poll& poll = {});

}  // namespace stretchmap::mesh
