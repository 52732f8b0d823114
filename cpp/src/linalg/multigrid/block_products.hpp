// Products of 3x3 blocks, for the sparse matrix products of the hierarchy.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// to[slot[col[f]]] += a b[f] for f in [0, count), blocks row-major. One number beyond the last b is
// read.
void add_block_products(const double* a, const float* b, const Index* col, Index count,
                        const Index* slot, double* to);
void add_block_products(const double* a, const double* b, const Index* col, Index count,
                        const Index* slot, double* to);

}  // namespace stretchmap::linalg
