// Linking numbers of loops on an embedded surface.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

using LinkingMatrix = Eigen::Matrix<std::int64_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// (k, k) entry (i, j) = lk(a_i, a_j lifted off the surface along its outward normal): the Seifert
// form of the surface in the classes of the loops.
//
// Nothing is moved by a finite distance. Loop a_j is replaced by the homologous loop c_j on its
// left that runs through midpoints of edges, so a_i and c_j meet only where c_j crosses an edge of
// a_i at its midpoint. Crossings are counted in a projection, and there the infinitesimal lift
// decides which of the two is above and whether their shadows cross at all.
//
// \pre    closed surface, faces outward, loops simple and not bounding a single face.
// \throws Error "SelfIntersectionError" where no projection decides: loops that touch elsewhere,
//         degenerate faces.
LinkingMatrix linking_matrix(const mesh::SurfaceTopology& top, const PointsRef& points,
                             const std::vector<Loop>& loops, const Poll& poll = {});

// Linking number of two closed polygons, the first point not repeated, by the signed crossings in
// a projection; exact, and of order n log n in time where the crossings are not many.
// \throws Error "SolverError" where no projection decides: they touch.
std::int64_t linking_number(const PointsRef& p, const PointsRef& q, const Poll& poll = {});

}  // namespace stretchmap::homology
