// Signed sizes of elements.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::mesh {

// \return (m, 3) half the cross product of two sides: the area as length, the normal as direction.
Points face_area_vectors(const PointsRef& points, const FacesRef& faces);

// \return the edges of face f from its first corner, as columns, in its own plane, the first along
//         x.
Eigen::Matrix2d plane_edges(const PointsRef& points, const FacesRef& faces, Index f);

// \return (m) unsigned areas.
Vec face_areas(const PointsRef& points, const FacesRef& faces);

// \return (k) det(v1 - v0, v2 - v0, v3 - v0) / 6, negative for an inverted tet.
Vec tet_volumes(const PointsRef& points, const TetsRef& tets);

// Computed from the centroid of the vertices, so that a mesh far away loses no digits.
// \pre the surface is closed and consistently oriented.
// \return the volume it encloses, positive when its faces point outward.
double enclosed_volume(const PointsRef& points, const FacesRef& faces);

// \return (m) or (k) true where an element has no size: the cross product (or the determinant) is
// at most max(1e-12 L, 16 eps C) L (or L^2), with L the element's longest edge, C the largest
// absolute coordinate of the mesh and eps the rounding unit. The first bound is relative to the
// element; the second is what rounding the coordinates themselves can do.
Eigen::Array<bool, Eigen::Dynamic, 1> degenerate_faces(const PointsRef& points,
                                                       const FacesRef& faces);
Eigen::Array<bool, Eigen::Dynamic, 1> degenerate_tets(const PointsRef& points, const TetsRef& tets);

// \return (e) Euclidean edge lengths.
Vec edge_lengths(const SurfaceTopology& top, const PointsRef& points);

}  // namespace stretchmap::mesh
