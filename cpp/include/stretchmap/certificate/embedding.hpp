// Exact tests behind the certificate: which tets are positive, whether a surface crosses itself.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::certificate {

// \return tets whose signed volume is not proven positive (exact sign, see orient3d), ascending.
IndexVec not_positive_tets(const PointsRef& points, const TetsRef& tets);

// \return whether two triangles have a point in common beyond the vertices or the edge they share
//         by number. Touching counts; degenerate triangles count as meeting. "false" is proven.
bool triangles_meet(const PointsRef& points, const Eigen::Matrix<Index, 1, 3>& a,
                    const Eigen::Matrix<Index, 1, 3>& b);

// \return (k, 2) pairs of faces that meet so, lower id first, lexicographic, the first `limit` of
//         them. An empty answer proves a closed surface without doubled vertices to be embedded.
Edges crossing_faces(const PointsRef& points, const FacesRef& faces, Index limit,
                     const Poll& poll = {});

}  // namespace stretchmap::certificate
