// Crossings of two polygons in a projection.
#pragma once

#include <array>

#include "stretchmap/base/types.hpp"

namespace stretchmap::homology {

// Signed crossings of p and q seen along z; each counts by the sign of (upper x lower).z. For
// disjoint closed polygons both sums are the linking number.
struct Crossings {
  std::int64_t p_above = 0;
  std::int64_t q_above = 0;
};

// The rotation of try number k, the same every time: for almost every mesh the first is generic.
Eigen::Matrix3d generic_rotation(int k);

// Adds up the crossings of two closed polygons, the first point not repeated. Trees of boxes leave
// out pairs of runs whose shadows are apart, so long polygons with few crossings take time of order
// n log n.
// \param p_mark  (np) of the segments of p, or empty
// \param q_mark  (nq) of the points of q, or empty. A segment of p and a segment of q with an end
//                of the same mark are left out.
// \return false where rounding leaves some crossing undecided: turn the polygons and try again
bool count_crossings(const Points& p, const Points& q, const IndexVecRef& p_mark,
                     const IndexVecRef& q_mark, Crossings& sum, const Poll& poll = {});

// A polyline that runs through the midpoint of a segment of p, lifted off it infinitesimally.
struct Touch {
  Eigen::Vector3d along;   // direction of the segment of p
  Eigen::Vector3d before;  // from the midpoint to where the polyline comes from
  Eigen::Vector3d after;   // and to where it goes
  Eigen::Vector3d lift;
};

// Adds the crossings of that segment with that part of the polyline q; false where undecided.
bool count_touch(const Touch& touch, Crossings& sum);

}  // namespace stretchmap::homology
