// Small meshes for tests of kernels, with what is known about them.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::tests {

// A torus of revolution with waves, on a grid of nu by nv vertices.
struct WavyTorus {
  Points points;  // (n, 3)
  mesh::SurfaceTopology topology;
  area::SurfaceChart chart;
  Points2 turns;  // (n, 2) around the axis and around the tube, somewhat off the grid
};
WavyTorus wavy_torus(int nu, int nv, double waves = 0.25);

// The standard solid torus and another one, connected alike, of about so many tets.
struct Solid {
  static constexpr double R = 3.0, r = 1.0;
  Points source;   // (n, 3) the other one
  Points points;   // (n, 3) the standard one
  Tets tets;       // (k, 4) positively oriented in both
  Flags boundary;  // (n)
};
Solid solid_torus(Index n_tets);

// (n, 3) independent normal numbers, the same ones for a seed.
Points random_points(Index n, unsigned seed);

}  // namespace stretchmap::tests
