// A generated solid torus: a disk in concentric rings carried once around, prisms cut into tets.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::bench {

struct SolidTorus {
  Points points;    // (n, 3) a torus whose tube swells and shrinks, so that there is work to do
  Points standard;  // (n, 3) the same vertices on the standard solid torus, same total volume
  Points2 turns;    // (n, 2) coordinates u, v in turns; v of the core line is zero
  Tets tets;        // (k, 4) positively oriented, k close to what was asked for
  double R = 3.0, r = 1.0;  // of `standard`, up to the scaling
};

// \pre n_tets >= 300, and below 2^31 / 18 so that every index fits.
SolidTorus solid_torus(Index n_tets);

}  // namespace stretchmap::bench
