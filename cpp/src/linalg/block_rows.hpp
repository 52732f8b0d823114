// The matrix of a solve as its owner keeps it: compressed rows of B x B blocks.
#pragma once

#include <array>

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

template <int B>
struct BlockRows {
  Index n = 0;  // block rows
  const Index *start = nullptr, *col = nullptr;
  const double* value = nullptr;  // row-major blocks
  double scale = 1.0;             // all are multiplied by

  // y = A x, K interleaved columns; returns x'y of each column.
  template <int K>
  std::array<double, K> multiply(const double* x, double* y) const;
};

}  // namespace stretchmap::linalg
