// The inner loop of BlockLdlt: what a finished column of L takes from a row in the making.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// Doubles a K x K block of the row takes: column-major, columns of 3 padded to 4.
template <int K>
inline constexpr int kWorkBlock = K == 2 ? 4 : 4 * K;

// work[rows[p]] -= y lower[p]' for all p < count; y like a block of work, lower in column-major
// blocks without padding. All processors give the same bits.
void subtract_updates_2(double* work, const double* y, const Index* rows, const double* lower,
                        Index count);
void subtract_updates_3(double* work, const double* y, const Index* rows, const double* lower,
                        Index count);

}  // namespace stretchmap::linalg
