// Energy of a surface glued to a torus of revolution, its vertices free to glide (two angles each),
// measured on the polyhedral image in space:
//
//   sum over faces w [ area   (rho - 1/rho)^2 / 4       rho   = |g(t)| / (scale |t|)
//                      + shape  ((s1/s2 + s2/s1)/2 - 1)   s     = singular values of the face's map
//                      + chart  (sigma + 1/sigma - 2)     sigma = signed area in the (u, v) chart
//                                                         times the torus' density at its middle,
//                                                         over |t|
//                      + facing mean((x^2 + 1) / chi(x) - 2) ]
//
// x = how far the flat face looks outward over |t|, at its corners and where it does least (see
// torus_graph.hpp), chi = (x + sqrt(x^2 + epsilon^2)) / 2. For epsilon = 0, x is twice that and the
// term nought from x = 1 on: what looks outward by half its area needs no barrier, and few faces
// have less. The chart term is infinite before a face can turn over in the chart; so is the facing
// term, for epsilon = 0, before a face breaks the certificate's condition, which a coarse one can
// do while its chart area is positive. With epsilon > 0 it is finite there and draws such faces
// back. Areas of source and torus are scaled to one.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/area/surface_reference.hpp"
#include "stretchmap/base/torus.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

struct SurfaceWeights {
  double area = 1.0;
  double shape = 0.0;
  double chart = 0.0;
  double facing = 0.0;
  double epsilon = 0.0;  // of the facing term; 0: infinite where a face looks inward
};

struct GlideProblem {
  SurfaceChart chart;
  SurfaceReference reference;
  double ratio = 2.0;  // R / r

  Torus torus() const { return Torus::of_area_one(ratio); }
};

struct GlideEnergy {
  double value = 0.0;  // infinity where a face has no positive area in the chart
  Vec gradient;        // (2n) by (u, v) of each vertex; empty if not asked for
  Rows hessians;       // (m, 36) one 6x6 matrix per face, empty if not asked for
};

// Most of the areas' own curvature in the model: with all of it the last per cent of the area
// ratios takes ever more steps, with none of it the steps get short.
inline constexpr double kModelCurvature = 0.25;

enum class Derivatives { kNone, kHessian, kModel };

// \param angles (n, 2) (u, v) in radians.
// \param derivatives kHessian is exact; kModel is what Newton steps use: positive semi-definite
//        face by face, with a part of the areas' own curvature only.
// \param curvature that part.
GlideEnergy glide_energy(const GlideProblem& problem, const SurfaceWeights& weights, double scale,
                         const Points2Ref& angles, Derivatives derivatives,
                         double curvature = kModelCurvature);

// \return the scale at which the area term is least: (sum (w rho^2) / sum (w / rho^2))^(1/4), with
//         rho = |g| / |t|.
double best_scale(const GlideProblem& problem, const Points2Ref& angles);

// \return (n, 3) points of the torus of area one.
Points glide_image(const GlideProblem& problem, const Points2Ref& angles);

// \return (m) least component of each face's area vector along the torus' normal, over its source
//         area: positive where the certificate's condition holds.
Vec least_facing(const GlideProblem& problem, const Points2Ref& angles);

// \return (m) areas of the polyhedral image; the torus itself has area one.
Vec glide_areas(const GlideProblem& problem, const Points2Ref& angles);

}  // namespace stretchmap::area
