// Ring areas made exact: n equations for 2n unknowns, so there is room to keep the faces good.
#pragma once

#include <optional>

#include "stretchmap/area/surface_energy.hpp"
#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"

namespace stretchmap::area {

enum class RingStep {
  kBest,   // best for the quadratic model of the energy
  kStiff,  // smallest when shape and chart are springs
  kAgain   // like the step before, with its matrix
};

// The equations of one step, three unknowns per vertex (u, v and the multiplier of its ring); the
// symbolic analysis is kept.
class RingSystem {
 public:
  RingSystem(const FacesRef& faces, Index n_vertices) : pattern_(faces, n_vertices, 3) {}

  // The change of the angles, (n, 2), that makes the area of every vertex ring (6.3) its share of
  // the total to first order and, among all that do, is best for the energy or smallest:
  //   [ H  J' ] [ dq ]   [ -g ]
  //   [ J  0  ] [ mu ] = [ -r ]
  // kAgain: J and H are those of the step before, and g is zero.
  // \throws Error "SolverError" when the factorization breaks down.
  Points2 step(const GlideProblem& problem, const SurfaceWeights& weights, double scale,
               const Points2Ref& angles, RingStep kind, const Poll& poll = {});

 private:
  SurfacePattern pattern_;                      // and the matrix of the last step but kAgain
  std::optional<linalg::BlockLdlt<3>> factor_;  // from the first step on
};

}  // namespace stretchmap::area
