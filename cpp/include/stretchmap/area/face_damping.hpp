// Newton directions that few faces cut short. A step ends before the first face turns over in the
// chart; among thousands of needles there always is one that does long before. So the relative
// change of the Jacobian of such faces, dJ J^-1, is penalized (Levenberg-Marquardt, face by face)
// and the system solved again. What a face was damped by fades in the steps that follow.
#pragma once

#include <functional>

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

struct DampedDirection {
  Points2 direction;
  double longest =
      0.0;  // step: at most 1, and nine tenths of the way to the first face turned over
};

class FaceDamping {
 public:
  using Solve = std::function<Points2(const Rows& hessians)>;

  // \param lengths of one turn along each coordinate, as far as their ratio goes.
  // \param turn one turn in the coordinates that steps are taken in.
  FaceDamping(Eigen::Vector2d lengths, double turn) : lengths_(lengths), turn_(turn) {}

  // \param weights (m) of the faces in the energy.
  // \param hessians (m, 36) of the faces by the coordinates that steps are taken in; changed.
  // \param solve the direction in these.
  DampedDirection direction(const SurfaceChart& chart, const Points2Ref& turns, const Vec& weights,
                            Rows& hessians, const Solve& solve);

 private:
  Eigen::Vector2d lengths_;
  double turn_;
  Vec damping_;  // (m) over the weights; empty: none
};

}  // namespace stretchmap::area
