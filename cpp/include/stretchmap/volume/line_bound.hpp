// How far tets can go along straight lines before they turn over.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::volume {

// \param tets (k, 4).
// \param x,direction (n, 3).
// \return (k) for each tet the largest alpha in (0, limit] up to which x + alpha * direction leaves
//         it positive, at most a millionth of its volume short of that; `limit` for a tet that is
//         not positive at x.
Vec longest_steps(const TetsRef& tets, const PointsRef& x, const PointsRef& direction,
                  double limit);

}  // namespace stretchmap::volume
