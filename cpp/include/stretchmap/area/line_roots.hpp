// How far a quantity that is quadratic along a line stays positive.
#pragma once

#include <cmath>
#include <limits>

namespace stretchmap::area {

// Smallest t > 0 with c + b t + a t^2 = 0, infinity if there is none. \pre c > 0.
inline double first_root(double c, double b, double a) {
  const double discriminant = b * b - 4.0 * a * c;
  if (discriminant < 0.0) return std::numeric_limits<double>::infinity();
  // 2c / (-b + sqrt(D)): the root nearest to 0 on the positive side, without cancellation for b < 0
  const double root = std::sqrt(discriminant);
  if (b < 0.0) return 2.0 * c / (root - b);
  return a < 0.0 ? (b + root) / (-2.0 * a) : std::numeric_limits<double>::infinity();
}

}  // namespace stretchmap::area
