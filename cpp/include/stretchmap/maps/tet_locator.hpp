// Which tet a point lies in: a uniform grid over a tet mesh, built once and asked many times.
#pragma once

#include <cstdint>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::maps {

struct TetLocation {
  IndexVec tet;  // (n) tet of each point, -1 outside
  Rows weights;  // (n, 4) barycentric coordinates, which sum to one; NaN outside
};

class TetLocator {
 public:
  // \param points,tets (n, 3) and (k, 4), copied. Tets without positive volume are never answered.
  // \param tolerance >= 0: a point no farther outside a tet counts as in it, with weights that are
  //        then slightly negative: they still reproduce the point.
  TetLocator(const PointsRef& points, const TetsRef& tets, double tolerance);

  // \param queries (n, 3)
  // \return the first of the tets that hold a point, else the one whose faces it violates least.
  TetLocation locate(const PointsRef& queries, const Poll& poll = {}) const;

 private:
  struct Best;
  Index cell(const Eigen::Vector3d& p) const;  // p is clamped to the grid
  void examine(const Eigen::Vector3d& p, Index t, Best& best) const;

  Points points_;
  Tets tets_;
  double tolerance_;
  Eigen::Vector3d low_, high_, inverse_cell_;
  Eigen::Array3i size_;
  Incidence<Index, std::int64_t> tets_in_;  // each cell
};

}  // namespace stretchmap::maps
