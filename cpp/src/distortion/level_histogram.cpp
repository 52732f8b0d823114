#include "stretchmap/distortion/level_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace stretchmap {

Vec level_histogram(const TetsRef& tets, const VecRef& values, const VecRef& amounts, Index bins,
                    double period, bool periodic) {
  const double far = (5.0 - std::sqrt(5.0)) / 20.0, near = 1.0 - 3.0 * far;
  const double per_bin = bins / period;
  Vec histogram = Vec::Zero(bins);
  for (Index t = 0; t < tets.rows(); ++t) {
    double value[4];
    for (int a = 0; a < 4; ++a) {
      value[a] = values[tets(t, a)];
      if (!periodic) continue;
      const double offset = value[a] - value[0];
      if (offset > 0.5 * period) value[a] -= period;
      if (offset < -0.5 * period) value[a] += period;
    }
    const double common = far * (value[0] + value[1] + value[2] + value[3]);
    for (int a = 0; a < 4; ++a) {
      double point = common + (near - far) * value[a];
      if (periodic) point -= period * std::floor(point / period);
      const double place = std::clamp(point * per_bin, 0.0, bins - 1.0);
      histogram[static_cast<Index>(place)] += 0.25 * amounts[t];
    }
  }
  return histogram;
}

}  // namespace stretchmap
