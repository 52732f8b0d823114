// Projected Newton steps on the energy of a surface gliding on the torus. No step is accepted that
// turns a face over in the chart or raises the energy.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "stretchmap/area/chart_system.hpp"
#include "stretchmap/area/face_damping.hpp"
#include "stretchmap/area/surface_energy.hpp"
#include "stretchmap/area/surface_rings.hpp"
#include "stretchmap/area/surface_sem.hpp"

namespace stretchmap::area {

class SurfaceNewton {
 public:
  // \param problem its reference as surface_reference gives it.
  // \param angles (n, 2) without faces flipped in the chart.
  // \param held (n) nonzero for vertices that stay where they are; empty: none does.
  // \throws Error "SolverError" if a face is flipped in the chart (ids: faces).
  SurfaceNewton(GlideProblem problem, Points2 angles, Flags held = {});

  // The scale of the areas is renewed first, which lowers the energy by itself.
  // \return before, after: with this step's weights and scale.
  // \throws Error "SolverError" when the factorization breaks down.
  NewtonStep step(const SurfaceWeights& weights, const Poll& poll = {});

  // Makes the ring areas exact: `least_best` steps of RingSystem that are best for the faces, up to
  // `most_best` while these are not as asked, then stiff ones; after one that gained enough the
  // next reuses its factor.
  // \return false, and nothing is changed, if that cannot be done without a flip or raises a figure
  //         of the faces above both what it was and the limit given.
  bool project_rings(const SurfaceWeights& weights, double face_std, double face_error,
                     int least_best, int most_best, const Poll& poll = {});

  // \return of the polyhedral image; flips are the faces that break the certificate's condition.
  SurfaceMeasures measures() const;

  // The least of least_facing.
  double facing() const;
  // \return the faces where that is not positive.
  std::vector<Index> inward() const;

  // Of the elimination in a step that needs one.
  double flops();
  // So far: more than steps where faces had to be damped.
  int solves() const { return solves_; }
  // Of the areas in the model of the next step: less after a step as long as it might be.
  double curvature() const { return curvature_; }

  const Points2& angles() const { return angles_; }
  // \pre no face is flipped in the chart.
  void move_to(Points2 angles) { angles_ = std::move(angles); }
  const GlideProblem& problem() const { return problem_; }

 private:
  ChartSystem& system();
  Points2 direction_of(const Rows& hessians, const Vec& gradient, const Poll& poll);
  double longest_step(const Points2& direction) const;

  GlideProblem problem_;
  Points2 angles_;
  Flags held_;
  FaceDamping damping_;
  int solves_ = 0;
  double curvature_ = kModelCurvature;
  std::optional<ChartSystem> system_;  // of these two one at a time
  std::optional<RingSystem> rings_;
};

}  // namespace stretchmap::area
