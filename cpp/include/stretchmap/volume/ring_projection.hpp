// Makes the volume of every free vertex' ring of tets exact by the smallest displacement.
//
// With r_i(x) the volume of the tets round vertex i and J the Jacobian of r over the free vertices,
// one step is the minimum-norm Newton step d = -J' (J J')^-1 (r(x) - target). There are three
// unknowns for every equation, so it converges quadratically; J J' acts like a Laplacian and is
// applied without being formed.
#pragma once

#include <vector>

#include "stretchmap/base/incidence.hpp"

namespace stretchmap::volume {

struct RingStep {
  Points x;            // moved points
  double error = 0.0;  // largest |r_i / target_i - 1| over free vertices before the step
  int cg_iterations = 0;
};

class RingProjection {
 public:
  // fixed (n): non-zero where a vertex stays. \pre tets index into [0, n).
  RingProjection(const TetsRef& tets, const FlagsRef& fixed);

  // One full step from x (n, 3) towards ring volumes target (n, entries of fixed vertices unused).
  // \throws SolverError if the conjugate gradients do not reach `tol` within max_cg iterations.
  RingStep step(const PointsRef& x, const VecRef& target, double tol, int max_cg,
                const Poll& poll = {}) const;

  // \return largest relative error of a free vertex' ring.
  double error(const PointsRef& x, const VecRef& target) const;

 private:
  Vec rings(const VecRef& tet_values) const;  // (n) sums over incident tets, 0 where fixed
  Points transposed(const std::vector<Points>& slopes, const Vec& z) const;  // J' z
  Vec forward(const std::vector<Points>& slopes, const Points& d) const;     // J d

  Tets tets_;
  Flags fixed_;
  Incidence<> corners_;  // of the tets round each vertex
};

}  // namespace stretchmap::volume
