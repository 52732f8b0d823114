// Newton steps towards equal area ratios in the flat chart, for maps so far from it that the fixed
// point (4.5) jams at the first face about to fold. Minimized in a step is
//
//   sum w_f [ area (D + 1/D - 2) + shape (|K|^2 / (2 D) - 1) ],   D = det K,
//
// with K the Jacobian from the source triangle enlarged to the area its image is to have next: the
// source's own share of the total, but no more than a factor `reach` away from the image's. So no
// face is asked for more than a Newton step can do, and the areas of far too small faces grow by
// that factor in every step. w_f is the mean of the image's share and of the cube root of the
// source's, m faces of 1/m each having 1/m: with the source's alone the few faces that hold most of
// the chart at first cost nothing and are crushed; with its share itself slivers of no area are led
// anywhere, and end all later steps.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/area/chart_system.hpp"
#include "stretchmap/area/surface_reference.hpp"
#include "stretchmap/area/surface_sem.hpp"
#include "stretchmap/area/triangle_energy.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

struct ChartStep : NewtonStep {
  double within = 0.0;  // share of the source's area whose target was its own share
};

class ChartNewton {
 public:
  // \param reference as surface_reference gives it.
  // \param aspect length of the torus along u over that along v.
  // \param turns (n, 2) without folded faces.
  // \throws Error "SolverError" if a face is folded (ids: faces).
  ChartNewton(SurfaceChart chart, SurfaceReference reference, double aspect, Points2 turns);

  // \pre reach > 1.
  ChartStep step(const TriangleWeights& weights, double reach, const Poll& poll = {});

  SurfaceMeasures measures() const;
  const Points2& turns() const { return turns_; }

 private:
  struct Targets {
    Vec areas;    // (m) of the enlarged source triangles, over their own
    Vec weights;  // (m)
  };
  Targets targets(double reach) const;
  Eigen::Matrix2d rest(const Targets& targets, Index f) const;
  Eigen::Matrix2d jacobian(const Points2& turns, const Targets& targets, Index f) const;
  double value(const Points2& turns, const TriangleWeights& weights, const Targets& targets) const;

  SurfaceChart chart_;
  SurfaceReference reference_;
  Eigen::Vector2d periods_;
  Points2 turns_;
  Rows rest_;  // (m, 4) inverse edge matrices of the source triangles, row-major
  ChartSystem system_;
};

}  // namespace stretchmap::area
