// Stretch energy minimization in the flat torus: Algorithm 4.1 with what cancels left out. A step
// freezes L_S, solves (4.5) for both unit-period coordinates with one factorization, and goes to
// the exact minimum of E_S on the way there, never over a face.
#pragma once

#include <optional>

#include "stretchmap/area/chart.hpp"
#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/base/types.hpp"
#include "stretchmap/linalg/spd_solver.hpp"

namespace stretchmap::area {

struct SurfaceMeasures {
  double energy = 0.0;      // E_S of shares of the area, at least 1
  Index flips = 0;          // faces with no or negative area in the chart
  double ring_std = 0.0;    // standard deviation of the area ratios of vertex rings (6.3)
  double face_std = 0.0;    // and of faces
  double face_error = 0.0;  // largest |ratio - 1| of a face
  double angle_mean = 0.0;  // see mean_angle_distortion; 0 where it is not computed
};

struct SemStep {
  double step = 0.0;      // fraction of the way to the solution of (4.5)
  double residual = 0.0;  // norm of the gradient of E_S before the step
};

class SurfaceSem {
 public:
  // \param areas (m) source areas, scaled here to total one.
  // \param aspect length of the torus along u over that along v.
  // \param turns (n, 2) where to start, faces already turned over are allowed.
  SurfaceSem(SurfaceChart chart, const VecRef& areas, double aspect, Points2 turns);

  // \throws Error "SolverError" when the factorization breaks down.
  SemStep step();

  SurfaceMeasures measures() const;
  const Points2& turns() const { return turns_; }

 private:
  double line_search(const Points2& direction) const;

  SurfaceChart chart_;
  Vec areas_;
  Eigen::Vector2d periods_;
  Points2 turns_;
  SurfacePattern pattern_;
  std::optional<linalg::SpdSolver> solver_;  // from the first step on
};

// \param source,image (m) shares of the total area, each sums to one.
// \param measured ring_std, face_std and face_error are filled in.
void ratio_measures(const FacesRef& faces, Index n_vertices, const VecRef& source,
                    const VecRef& image, SurfaceMeasures& measured);

}  // namespace stretchmap::area
