// Distortion of one tet as a function of its Jacobian J, valid for inverted tets too.
//
//   psi(J) = shape * (tr(J^T J) / (3 chi^(2/3)) - 1) + volume * ((det^2 J + 1) / (2 chi) - 1)
//   chi    = (det J + sqrt(epsilon^2 + det^2 J)) / 2
//
// chi regularises the determinant so that the energy is finite and smooth on inverted elements and
// turns into det J as epsilon goes to 0 (Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov,
// ACM TOG 40(4), 2021). At epsilon = 0 the first term measures shape only, the second is
// (det + 1/det)/2 - 1: both are barriers against inversion and vanish at rotations.
#pragma once

#include <cmath>

#include "stretchmap/base/types.hpp"

namespace stretchmap {

struct EnergyWeights {
  double shape = 1.0;
  double volume = 1.0;
  double epsilon = 0.0;  // 0: barrier; the energy is infinite on inverted tets and folded faces
  double face = 0.0;     // of the boundary triangles, where the boundary glides
};

// chi(det) and its first two derivatives.
struct Regularised {
  double value, first, second;
};

inline Regularised regularised(double det, double epsilon) {
  if (epsilon <= 0.0) return {det, 1.0, 0.0};
  const double root = std::sqrt(epsilon * epsilon + det * det);
  // For negative det the sum of the definition cancels; this is the same number.
  const double chi = det >= 0.0 ? 0.5 * (det + root) : 0.5 * epsilon * epsilon / (root - det);
  return {chi, chi / root, 0.5 * epsilon * epsilon / (root * root * root)};
}

using Matrix9 = Eigen::Matrix<double, 9, 9>;

// Value of psi; +infinity when epsilon = 0 and det J <= 0.
double element_energy(const Eigen::Matrix3d& J, const EnergyWeights& w);

// Value, gradient P = d psi / dJ and, if H is given, the Hessian with respect to vec(J)
// (column-major) with its negative eigenvalues set to zero. The eigenvalues come in closed form
// from the singular values (Smith, de Goes, Kim, ACM TOG 38(1), 2019).
// \pre element_energy(J, w) is finite.
double element_energy(const Eigen::Matrix3d& J, const EnergyWeights& w, Eigen::Matrix3d& P,
                      Matrix9* H);

}  // namespace stretchmap
