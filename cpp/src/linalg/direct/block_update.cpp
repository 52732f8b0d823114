#include "linalg/direct/block_update.hpp"

#include <cstddef>

#include "stretchmap/base/clones.hpp"

namespace stretchmap::linalg {

STRETCHMAP_CLONES void subtract_updates_2(double* work, const double* y, const Index* rows,
                                          const double* lower, Index count) {
  // Both columns of a block at once.
  const double first[4] = {y[0], y[1], y[0], y[1]}, second[4] = {y[2], y[3], y[2], y[3]};
  for (Index p = 0; p < count; ++p, lower += 4) {
    double* to = work + 4 * static_cast<std::ptrdiff_t>(rows[p]);
    const double a[4] = {lower[0], lower[0], lower[1], lower[1]};
    const double b[4] = {lower[2], lower[2], lower[3], lower[3]};
    double row[4];
    for (int l = 0; l < 4; ++l) row[l] = to[l] - (first[l] * a[l] + second[l] * b[l]);
    for (int l = 0; l < 4; ++l) to[l] = row[l];
  }
}

STRETCHMAP_CLONES void subtract_updates_3(double* work, const double* y, const Index* rows,
                                          const double* lower, Index count) {
  using Column = double[4];
  Column in[3];
  for (int d = 0; d < 3; ++d)
    for (int l = 0; l < 4; ++l) in[d][l] = y[4 * d + l];
  for (Index p = 0; p < count; ++p, lower += 9) {
    double* to = work + 12 * static_cast<std::ptrdiff_t>(rows[p]);
    Column out[3];
    for (int c = 0; c < 3; ++c) {
      const double a = lower[c], b = lower[3 + c], d = lower[6 + c];
      for (int l = 0; l < 4; ++l)
        out[c][l] = to[4 * c + l] - (in[0][l] * a + in[1][l] * b + in[2][l] * d);
    }
    for (int c = 0; c < 3; ++c)
      for (int l = 0; l < 4; ++l) to[4 * c + l] = out[c][l];
  }
}

}  // namespace stretchmap::linalg
