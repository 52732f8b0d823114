// Which tet a point lies in: a tree of boxes over a tet mesh, built once and asked many times.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::maps {

struct TetLocation {
  IndexVec tet;  // (n) tet of each point, -1 outside
  Rows weights;  // (n, 4) barycentric coordinates, which sum to one; NaN outside
};

// A box lies along the axes of the tets in it, halved where the fewest of these reach over the cut:
// those of flat or slender tets, however these are turned, hardly overlap.
class TetLocator {
 public:
  // \param points,tets (n, 3) and (k, 4), copied. Tets without positive volume are never answered.
  // \param tolerance >= 0: a point no farther outside a tet counts as in it, with weights that are
  //        then slightly negative: they still reproduce the point.
  TetLocator(const PointsRef& points, const TetsRef& tets, double tolerance, const Poll& poll = {});

  // \param queries (n, 3)
  // \return the first of the tets that hold a point, else the one whose faces it violates least.
  TetLocation locate(const PointsRef& queries, const Poll& poll = {}) const;

  // \return (n) how many boxes and tets are looked at for each point.
  IndexVec visits(const PointsRef& queries) const;

 private:
  struct Box {
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // rows
    Eigen::Vector3d low, high;                           // along them
    Index begin = 0, end = 0;                            // of order_
    Index second = -1;  // the second half, the first being the next box; -1 in a leaf
    Index first_tet = 0;
  };
  struct Best;
  struct Halving;

  Eigen::Vector3d unit(const Eigen::Vector3d& p) const { return (p - center_) * scale_; }
  void grow(Index begin, Index end, const Eigen::Matrix3d& axes, Halving& halving,
            const Poll& poll);
  void measure(Box& box, Halving& halving) const;
  void examine(const Eigen::Vector3d& p, Index t, Best& best) const;
  Best find(const Eigen::Vector3d& p) const;

  Points points_;
  Tets tets_;
  double tolerance_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double scale_ = 1.0;        // boxes are those of a mesh about as large as one, at the origin
  std::vector<Index> order_;  // tets, those of a box side by side
  std::vector<Box> boxes_;    // depth first
};

}  // namespace stretchmap::maps
