// Projected Newton steps towards areas in the flat chart, in stages a Newton step can follow.
//
//   sum |t| [ area (D + 1/D - 2) + shape (|K|^2 / (2 D) - 1) ],   D = det K,
//
// K the Jacobian from the source triangle, enlarged to the area a tau of its image that is wanted
// next: the source's own share a, but not more than a factor `reach` away from the image's. Areas
// of source and chart are scaled to one.
#pragma once

#include <optional>

#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/area/surface_quality.hpp"
#include "stretchmap/area/surface_sem.hpp"
#include "stretchmap/base/types.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"

namespace stretchmap::area {

struct ChartStep {
  double before = 0.0, after = 0.0;
  double step = 0.0;
  double decrement = 0.0;
  double reached = 0.0;  // share of the source's area whose target is its own share
};

class ChartNewton {
 public:
  ChartNewton(SurfaceChart chart, SurfaceReference reference, double aspect, Points2 turns);
  ChartStep step(double area, double shape, double reach, int mix, const Poll& poll = {});
  SurfaceFigures figures() const;
  const Points2& turns() const { return turns_; }

 private:
  double energy(const Points2& turns, const Vec& tau, double area, double shape) const;
  double longest_step(const Points2& direction) const;
  Eigen::Matrix2d jacobian(const Points2& turns, Index f, double tau) const;

  SurfaceChart chart_;
  SurfaceReference reference_;
  Eigen::Vector2d periods_;
  Points2 turns_;
  Rows rest_;
  Vec weights_;
  SurfacePattern pattern_;
  std::optional<linalg::BlockLdlt<2>> solver_;
};

}  // namespace stretchmap::area
