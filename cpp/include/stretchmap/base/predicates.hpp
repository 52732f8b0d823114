// Signs of determinants, exact: a rounding-error bound settles the easy cases, floating-point
// expansions the rest (Shewchuk, Discrete & Computational Geometry 18, 1997).
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap {

using Point = Eigen::Vector3d;

// \return sign of det(b - a, c - a, d - a): +1 when (a, b, c, d) is a positively oriented tet, -1
// when it is inverted, 0 when it is flat. Exact as long as the coordinate differences that are not
// zero lie between 2^-300 and 2^300 in absolute value, rounding parts included; outside that range
// 0 is returned unless the error bound settles the sign, so a nonzero answer can always be trusted.
int orient3d(const Point& a, const Point& b, const Point& c, const Point& d);

// \return sign of det(b - a, c - a) of the points without coordinate `axis` (0, 1, 2), the other
// two in ascending order. Trust as above.
int orient2d(const Point& a, const Point& b, const Point& c, int axis);

}  // namespace stretchmap
