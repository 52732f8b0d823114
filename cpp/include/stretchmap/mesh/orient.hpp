// Consistent orientation by walking from element to element across shared facets.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/facets.hpp"

namespace stretchmap::mesh {

// Elements linked across facets that exactly two of them share.
struct Patches {
  Index count = 0;
  IndexVec patch;                // (m) patch of each element, -1 where skipped; numbered by lowest
                                 //     element
  Mask turned;                   // (m) 1 where an element runs against the first of its patch
  Mask closed;                   // (count) 1 where every facet of the patch has two elements
  std::vector<Index> conflicts;  // elements at facets where no turning helps: not orientable
};

// \pre indices in range; no element that is not skipped repeats a vertex.
Patches face_patches(const FacesRef& faces, const FacetGroups& half_edges, const Mask& skip = {});
Patches tet_patches(const TetsRef& tets, const FacetGroups& half_faces, const Mask& skip = {});

// \return which elements to turn so that every patch is consistent and
// - a closed patch of faces encloses a positive volume, an open one goes with its majority (with
//   its first face in a draw);
// - a patch of tets has a positive volume in total.
// A folded tet, consistent with its neighbors but negative, is not turned: turning it would hide
// the fold.
Mask faces_to_turn(const PointsRef& points, const FacesRef& faces, const Patches& patches);
Mask tets_to_turn(const PointsRef& points, const TetsRef& tets, const Patches& patches);

// \return the same for a whole mesh, as ids. Elements that repeat a vertex and second copies of an
//         element take no part and are never turned.
IndexVec misoriented_faces(const PointsRef& points, const FacesRef& faces);
IndexVec misoriented_tets(const PointsRef& points, const TetsRef& tets);

// \return indices of all set entries, ascending.
IndexVec set_entries(const Mask& mask);

}  // namespace stretchmap::mesh
