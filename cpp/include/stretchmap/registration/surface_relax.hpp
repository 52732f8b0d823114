// Vertex-by-vertex search for a lower energy of surface_match.hpp.
//
// The target is a polyhedron: along its edges the energy has kinks, where steps of all vertices at
// once get stuck. Moving one vertex at a time, by values only, gets past most of them.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/types.hpp"
#include "stretchmap/registration/surface_walk.hpp"

namespace stretchmap::registration {

// `sweeps` times over all vertices in order, each tried a step of length reach[i] (see Reach) in
// eight directions of the target; the best is taken if it lowers the energy.
// y (n, 2) chart positions, X (n, 3) points, reach (n) are replaced; held (n): nonzero stays;
// rest, weights as in surface_match.hpp. \pre match_value is finite.
RelaxReport relax_match(const area::SurfaceChart& chart, const SurfaceWalk& target,
                        const RowsRef& rest, const VecRef& weights, const FlagsRef& held,
                        int sweeps, Points2& y, Points& X, Vec& reach, const Poll& poll = {});

}  // namespace stretchmap::registration
