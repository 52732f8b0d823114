// A disk of triangles drawn with straight edges, every triangle with room.
//
// However a disk is embedded harmonically, what lies behind necks of few edges shrinks by a factor
// with every edge. Not so with W. Schnyder's (Embedding planar graphs on the grid, SODA 1990):
// inner edges form three trees, one to each corner, and a vertex is at the barycentric coordinates
// that count the triangles in the three regions its paths to the corners cut out.
#pragma once

#include <array>

#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// (n, 3) barycentric coordinates in the triangle of the corners, whole multiples of 1 / (2 n - 5):
// no triangle is smaller than 1 / (2 n - 5)^2 of it, and all are turned as `faces` are.
//
// \param faces   (2 n - 5, 3) counterclockwise, of a disk without other vertices at its rim
// \param n       number of vertices
// \param corners of the rim, counterclockwise
// \throws Error  "ArrayError" if the faces are no such disk
Points straight_drawing(const FacesRef& faces, Index n, const std::array<Index, 3>& corners);

}  // namespace stretchmap::area
