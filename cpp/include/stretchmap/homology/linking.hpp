// Linking numbers of loops on an embedded surface.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap {

// (k, k) entry (i, j) = lk(a_i, a_j lifted off the surface along its outward normal): the Seifert
// form of the surface in the classes of the loops.
//
// Nothing is moved by a finite distance. Loop a_j is replaced by the homologous loop c_j on its
// left that runs through midpoints of edges, so a_i and c_j meet only where c_j crosses an edge of
// a_i at its midpoint, and there the lift decides exactly:
//     lk(a_i, c_j lifted) = G(a_i, c_j) + sum over crossings of +-phi / (2 pi)
// with + where c_j crosses a_i from left to right, phi the dihedral angle outside the surface, and
// G the Gauss integral: the solid angles of pairs of segments over 4 pi, pairs that touch left out.
// (The differences of nearby points fill two half-planes along the faces; seen from the origin,
// which the lift puts below them, these fill the solid angle 2 phi.)
//
// \pre    closed surface, faces outward, loops simple and not bounding a single face.
// \throws Error "SolverError" when an entry is further than 1e-6 from an integer.
Rows linking_matrix(const SurfaceTopology& top, const PointsRef& points,
                    const std::vector<Loop>& loops, const Poll& poll = {});

// Gauss integral of two disjoint closed polygons: their linking number, to rounding.
double gauss_linking(const PointsRef& p, const PointsRef& q);

}  // namespace stretchmap
