// An ordering of the unknowns in which neighbors are close.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// order[new] = old: breadth first from an end of every component of the symmetric pattern.
std::vector<Index> breadth_first_order(Index n, const Index* start, const Index* col);

}  // namespace stretchmap::linalg
