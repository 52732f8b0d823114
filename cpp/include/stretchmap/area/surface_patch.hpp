// The neighborhood of a few faces, where the rest of the surface is to stay as it is.
#pragma once

#include <vector>

#include "stretchmap/area/surface_energy.hpp"

namespace stretchmap::area {

struct SurfacePatch {
  GlideProblem problem;  // of its faces alone; areas are shares of the whole surface
  IndexVec vertices;     // of the surface, by row
  Flags held;            // 1 for a vertex with faces outside
};

// \param faces of the surface, whose corners are free.
// \param rings of faces round those corners; whatever lies inside all of them is free, too.
// \pre rings >= 1.
SurfacePatch surface_patch(const GlideProblem& problem, const std::vector<Index>& faces, int rings);

}  // namespace stretchmap::area
