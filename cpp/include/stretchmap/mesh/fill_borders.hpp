// Closing the holes of a surface.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::mesh {

struct BorderFill {
  std::vector<std::vector<Index>> loops;  // vertices round each hole, as the border runs
  Faces faces;                            // what fills them, oriented as the faces beside them
  IndexVec hole;                          // (len(faces)) the hole each face fills
  Points centers;                         // new vertices, numbered after those of the surface
};

// Fills every border loop with the triangulation of least area over its vertices (Barequet, Sharir,
// Computer Aided Geometric Design 12, 1995). Diagonals that are edges of the surface already are
// not used; where that leaves no triangulation, a star round the center of the loop fills it. Long
// loops are first parted along short diagonals, so that the time stays below quadratic in practice.
// \throws Error "NonManifoldError" for a border that passes through a vertex twice.
BorderFill fill_borders(const PointsRef& points, const SurfaceTopology& top, const Poll& poll = {});

}  // namespace stretchmap::mesh
