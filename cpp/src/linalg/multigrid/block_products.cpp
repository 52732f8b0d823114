#include "linalg/multigrid/block_products.hpp"

#include <cstddef>

#include "stretchmap/base/clones.hpp"

namespace stretchmap::linalg {
namespace {

// Rows of three numbers in lanes of four, the last of them idle.
template <class Real>
STRETCHMAP_INLINE void add_products(const double* a, const Real* b, const Index* col, Index count,
                                    const Index* slot, double* to) {
  for (Index f = 0; f < count; ++f, b += 9) {
    double rows[3][4], sum[3][4];
    for (int m = 0; m < 3; ++m)
      for (int c = 0; c < 4; ++c) rows[m][c] = b[3 * m + c];
    double* out = to + 9 * static_cast<std::ptrdiff_t>(slot[col[f]]);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) sum[r][c] = r < 2 || c < 3 ? out[3 * r + c] : 0.0;
    for (int m = 0; m < 3; ++m)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c) sum[r][c] += a[3 * r + m] * rows[m][c];
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) out[3 * r + c] = sum[r][c];
  }
}

}  // namespace

STRETCHMAP_CLONES
void add_block_products(const double* a, const float* b, const Index* col, Index count,
                        const Index* slot, double* to) {
  add_products(a, b, col, count, slot, to);
}

STRETCHMAP_CLONES
void add_block_products(const double* a, const double* b, const Index* col, Index count,
                        const Index* slot, double* to) {
  add_products(a, b, col, count, slot, to);
}

}  // namespace stretchmap::linalg
