// Which face of a flat torus a point lies in: the same idea as TetLocator, periodic in both
// coordinates.
#pragma once

#include <cstdint>
#include <limits>

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::registration {

struct FaceLocation {
  IndexVec face;   // (n) face of each point, -1 if no face holds it
  Points weights;  // (n, 3) barycentric coordinates, none below -1e-9
};

class ChartLocator {
 public:
  struct Hit {
    Index face = -1;
    Eigen::Vector3d weights = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  };

  // turns (n, 2): chart coordinates of the vertices. \pre every face is smaller than half a turn.
  // Faces without positive area are never answered.
  ChartLocator(area::SurfaceChart chart, const Points2Ref& turns);

  // \param queries (n, 2) in turns, any branch.
  FaceLocation locate(const Points2Ref& queries) const;

  // \return the same for one point, without threads.
  Hit find(const Eigen::Vector2d& query) const;

 private:
  Index wrap(double coordinate) const;

  area::SurfaceChart chart_;
  Points2 turns_;
  Index size_;                            // cells per turn
  Incidence<Index, std::int64_t> faces_;  // of each cell
};

}  // namespace stretchmap::registration
