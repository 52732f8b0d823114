// The order in which edges of a solid are halved.
//
// Tets keep more of their shape where their longest edge is halved first (M.-C. Rivara, Int. J.
// Numer. Methods Eng. 20(4), 1984). Edges of nearly one length stay in the order they are in, as
// rounding is not to decide between those of a regular grid.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

// (e) the edges from the longest to the shortest; the result depends on neither the scale nor,
// but for edges whose lengths agree within 3 %, on their order.
IndexVec longest_first(const PointsRef& points, const EdgesRef& edges);

}  // namespace stretchmap::mesh
