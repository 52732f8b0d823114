// Vertex-by-vertex search for a better hexahedral mesh of a solid.
//
// A hexahedron is judged by the tets at its eight corners, each made of the corner and its three
// neighbours:
//
//   Psi = sum_c weight_c max(psi(J_c) - slack, 0)^power + sum_i pull_i |x_i - home_i|^2,
//   J_c = [x1 - x0, x2 - x0, x3 - x0] rest_c,
//
// psi that of element_energy.hpp: corners good enough ask for nothing, a large power sees little
// but the worst. Inner vertices move in space, those of the rim along the surface of the solid.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/registration/surface_walk.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::resample {

struct GridCorners {
  TetsRef tets;    // (c, 4) the corner first
  RowsRef rest;    // (c, 9) row-major 3x3
  VecRef weights;  // (c)
};

struct GridEnergy {
  volume::EnergyWeights corner;  // of psi
  double slack = 0.0;
  double power = 1.0;
  PointsRef home;     // (n, 3)
  Points2Ref home_y;  // (b, 2) chart positions of the rim at home
  VecRef pull;        // (n)
};

// `sweeps` times over all vertices in order, each tried a step of length reach[i] (see Reach) in
// fourteen directions of space or eight of the surface, and on the way home; the best is taken if
// it lowers Psi.
// rim (b): ids of the vertices on the surface; y (b, 2) their chart positions; x (n, 3) and
// reach (n). y, x and reach are replaced. \pre Psi is finite.
registration::RelaxReport relax_grid(const GridCorners& corners, const GridEnergy& energy,
                                     const registration::SurfaceWalk& surface,
                                     const IndexVecRef& rim, int sweeps, Points2& y, Points& x,
                                     Vec& reach, const Poll& poll = {});

}  // namespace stretchmap::resample
