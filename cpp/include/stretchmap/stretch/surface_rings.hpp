// Ring areas made exact: n equations for 2n unknowns, so there is room to keep the faces good.
#pragma once

#include "stretchmap/stretch/surface_energy.hpp"
#include "stretchmap/stretch/surface_pattern.hpp"

namespace stretchmap {

enum class RingStep {
  kBest,     // best for the quadratic model of the energy
  kSmallest  // shortest, lengths measured on the torus
};

// The change of the angles, (n, 2), that makes the area of every vertex ring (6.3) its share of the
// total to first order and, among all that do, is best for the energy or shortest:
//   [ H  J' ] [ dq ]   [ -g ]
//   [ J  0  ] [ mu ] = [ -r ]
// pattern: three unknowns per vertex (u, v and the multiplier of its ring).
// \throws Error "SolverError" when the factorisation breaks down.
Points2 ring_step(const SurfacePattern& pattern, const GlideProblem& problem,
                  const SurfaceWeights& weights, double scale, const Points2Ref& angles,
                  RingStep kind);

}  // namespace stretchmap
