// The line search of every Newton step.
#pragma once

namespace stretchmap::linalg {

// Share of the decrease promised by the slope that is demanded (Armijo).
inline constexpr double kArmijo = 1e-4;

// \param before energy at the start.
// \param slope of the energy along the direction, negative.
// \param energy double(alpha), not finite where a step must not end.
// \return the first of `longest`, its half, its quarter, ... whose energy is low enough, 0 if none
//         of `tries` is.
template <class Energy>
double backtrack(double before, double slope, double longest, int tries, const Energy& energy) {
  double alpha = longest;
  for (int k = 0; k < tries; ++k, alpha *= 0.5)
    if (energy(alpha) <= before + kArmijo * alpha * slope) return alpha;
  return 0.0;
}

}  // namespace stretchmap::linalg
