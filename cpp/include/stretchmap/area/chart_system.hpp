// Newton steps of a surface whose vertices have two coordinates each.
#pragma once

#include <optional>

#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"

namespace stretchmap::area {

struct NewtonStep {
  double before = 0.0;     // energy with this step's weights and targets, before
  double after = 0.0;      // and after the step
  double step = 0.0;       // fraction of the Newton step taken, 0: none decreases the energy
  double decrement = 0.0;  // Newton decrement g' H^-1 g
};

// The symbolic analysis is kept from the first step on.
class ChartSystem {
 public:
  // \param ridge share of the mean diagonal that is added to it: holds what costs no energy.
  ChartSystem(const FacesRef& faces, Index n_vertices, double ridge)
      : pattern_(faces, n_vertices, 2), ridge_(ridge) {}

  // \param hessians (m, 36) of the faces, positive semi-definite.
  // \return (2 n) -H^-1 gradient.
  // \throws Error "SolverError" when the factorization breaks down.
  Vec solve(const Rows& hessians, const Vec& gradient, const Poll& poll);

  // Of the elimination in each solve.
  double flops() { return solver().flops(); }

 private:
  linalg::BlockLdlt<2>& solver();

  SurfacePattern pattern_;
  double ridge_;
  std::optional<linalg::BlockLdlt<2>> solver_;
};

}  // namespace stretchmap::area
