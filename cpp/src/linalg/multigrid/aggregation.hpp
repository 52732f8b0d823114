// Which unknowns are strongly coupled, and their grouping into aggregates.
#pragma once

#include <vector>

#include "linalg/multigrid/level_matrix.hpp"

namespace stretchmap::linalg {

struct Aggregates {
  Index count = 0;
  std::vector<Index> of;     // (n) aggregate of each block row, -1 for one without neighbors
  std::vector<char> strong;  // per off-diagonal entry of the level matrix
};

// Entry (i, j) is strong if its coupling is at least `threshold` times the largest of row i or of
// row j. The coupling of a scalar entry is -a_ij (a positive entry pushes apart and is never
// strong), that of a block its norm.
template <int B>
Aggregates aggregate(const LevelMatrix<B>& A, double threshold);

}  // namespace stretchmap::linalg
