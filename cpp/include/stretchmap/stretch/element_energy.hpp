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

#include "stretchmap/base/types.hpp"

namespace stretchmap {

struct EnergyWeights {
  double shape = 1.0;
  double volume = 1.0;
  double epsilon = 0.0;  // 0: barrier; the energy is infinite on inverted tets
  double face = 0.0;     // of the boundary triangles, where the boundary glides
};

using Matrix9 = Eigen::Matrix<double, 9, 9>;

// Value of psi; +infinity when epsilon = 0 and det J <= 0.
double element_energy(const Eigen::Matrix3d& J, const EnergyWeights& w);

// Value, gradient P = d psi / dJ and, if H is given, the Hessian with respect to vec(J)
// (column-major) with its negative eigenvalues set to zero. The eigenvalues come in closed form
// from the singular values (Smith, de Goes, Kim, ACM TOG 38(1), 2019).
// \pre element_energy(J, w) is finite.
double element_energy(const Eigen::Matrix3d& J, const EnergyWeights& w, Eigen::Matrix3d& P,
                      Matrix9* H);

using Matrix4 = Eigen::Matrix<double, 4, 4>;

// The same idea for a boundary triangle in a flat chart,
//   phi(K) = tr(K^T K) / (2 det K) - 1 + (det K + 1 / det K) / 2 - 1,
// a barrier against folding: +infinity when det K <= 0.
double face_energy(const Eigen::Matrix2d& K);

// Value, gradient and projected Hessian with respect to vec(K). \pre det K > 0.
double face_energy(const Eigen::Matrix2d& K, Eigen::Matrix2d& P, Matrix4& H);

}  // namespace stretchmap
