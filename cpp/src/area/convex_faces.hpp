// Hessians of single faces for Newton steps.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// Takes the negative eigenvalues from the symmetric 6x6 matrices in rows [begin, end), each of
// which comes out the same whichever others are with it.
void make_convex(Rows& hessians, Index begin, Index end);

}  // namespace stretchmap::area
