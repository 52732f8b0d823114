// The stages of the pipeline as benchmark rows, named stage.step like the folders of the core.
#pragma once

#include <string>
#include <vector>

#include "harness.hpp"
#include "solid_torus.hpp"

namespace stretchmap::bench {

struct Settings {
  int threads = 1;
  int vsem_steps = 5;
  double c = 10.0;                // of (5.6)
  int newton_steps = 3;           // 0: leave the certified route out
  double bandwidth = 0.0;         // bytes per second of the copy probe with the same threads
  std::vector<std::string> only;  // groups to run, all if empty: mesh, surface, linalg, volume,
                                  // newton
};

using Report = std::function<void(Record)>;

// mesh: topology and diagnosis. surface: homology, forms, conformal and area map of the boundary.
void surface_stages(const SolidTorus& solid, const Settings& settings, const Report& report);

// linalg: the solvers on the system of the harmonic map.
void linalg_stages(const SolidTorus& solid, const Settings& settings, const Report& report);

// volume: assembly, harmonic map and steps of Algorithm 5.1. newton: the certified route.
void volume_stages(const SolidTorus& solid, const Settings& settings, const Report& report);

// Whether a group is asked for.
bool wanted(const Settings& settings, const std::string& group);

// "stage/size/threads:n".
std::string row_name(const std::string& stage, const SolidTorus& solid, const Settings& settings);

}  // namespace stretchmap::bench
