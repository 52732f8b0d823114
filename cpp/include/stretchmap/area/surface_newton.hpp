// Projected Newton steps on the energy of a surface gliding on the torus. No step is accepted that
// turns a face over in the chart or raises the energy.
#pragma once

#include <optional>

#include "stretchmap/area/surface_energy.hpp"
#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/area/surface_rings.hpp"
#include "stretchmap/area/surface_sem.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"

namespace stretchmap::area {

struct GlideStep {
  double before = 0.0;     // energy with this step's weights and scale, before
  double after = 0.0;      // and after the step
  double step = 0.0;       // fraction of the Newton step taken, 0: none decreases the energy
  double decrement = 0.0;  // Newton decrement g' H^-1 g
};

class SurfaceNewton {
 public:
  // areas of `problem` as surface_reference gives them; angles (n, 2) without flipped faces. Faces
  // are kept facing outward if all of them do at the start.
  // \throws Error "SolverError" if a face is flipped in the chart (ids: faces).
  SurfaceNewton(GlideProblem problem, Points2 angles);

  // The scale of the areas is renewed first, which lowers the energy by itself.
  GlideStep step(const SurfaceWeights& weights, const Poll& poll = {});

  // Makes the ring areas exact: two steps of RingSystem that are best for the faces, then stiff
  // ones; after one that gained enough the next reuses its factor. Refused (false, nothing changed)
  // if that cannot be done without a flip or raises a figure of the faces above both what it was
  // and the limit given.
  bool project_rings(const SurfaceWeights& weights, double face_sd, double face_error,
                     const Poll& poll = {});

  // Of the polyhedral image; flips are the faces that break the certificate's condition.
  SurfaceFigures figures() const;

  // As least_facing.
  double facing() const { return least_facing(problem_, angles_); }

  const Points2& angles() const { return angles_; }
  const GlideProblem& problem() const { return problem_; }

 private:
  void factorize(const Rows& hessians, const Poll& poll);
  double longest_step(const Points2& direction) const;

  GlideProblem problem_;
  Points2 angles_;
  SurfacePattern pattern_;
  std::optional<RingSystem> rings_;
  std::optional<linalg::BlockLdlt<2>> solver_;  // from the first step on
};

}  // namespace stretchmap::area
