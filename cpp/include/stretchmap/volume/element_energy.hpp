// Distortion of one tet as a function of its Jacobian J, valid for inverted tets too.
//
//   psi(J) = shape * (tr(J^T J) / (3 chi^(2/3)) - 1) + volume * ((det^2 J + 1) / (2 chi) - 1)
//   chi    = (det J + sqrt(epsilon^2 + det^2 J)) / 2
//
// chi regularizes the determinant so that the energy is finite and smooth on inverted elements and
// turns into det J as epsilon goes to 0 (Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov,
// ACM TOG 40(4), 2021). At epsilon = 0 the first term measures shape only, the second is
// (det + 1/det)/2 - 1: both are barriers against inversion and vanish at rotations.
//
// Several tets are evaluated at a time, one in each lane of the processor's vectors.
#pragma once

#include <cmath>

#include "stretchmap/base/types.hpp"

namespace stretchmap::volume {

struct EnergyWeights {
  double shape = 1.0;
  double volume = 1.0;
  double epsilon = 0.0;   // 0: barrier; the energy is infinite on inverted tets and folded faces
  double face = 0.0;      // of the boundary triangles, where the boundary glides
  double negative = 0.0;  // share of its negative eigenvalues that a model's Hessian keeps, below 1
  double soft = 0.0;      // share of how far a tet is inverted that its own epsilon is at least
};

struct Regularized {
  double value, first, second;
};

// \return chi(det) and its first two derivatives.
inline Regularized regularized_by_square(double det, double square) {
  if (square <= 0.0) return {det, 1.0, 0.0};
  const double root = std::sqrt(square + det * det);
  // For negative det the sum of the definition cancels; this is the same number.
  const double chi = det >= 0.0 ? 0.5 * (det + root) : 0.5 * square / (root - det);
  return {chi, chi / root, 0.5 * square / (root * root * root)};
}

inline Regularized regularized(double det, double epsilon) {
  return regularized_by_square(det, epsilon > 0.0 ? epsilon * epsilon : 0.0);
}

inline constexpr int kLanes = 8;
using Lane = double[kLanes];

// Tets (x0, x1, x2, x3) with J = [x1 - x0, x2 - x0, x3 - x0] * rest. Lanes that are not needed have
// to hold a copy of one that is.
struct ElementBatch {
  // Input.
  alignas(64) Lane edges[9];  // edges[3 a + i] is component i of x_{a+1} - x0
  alignas(64) Lane rest[9];   // row-major
  alignas(64) Lane weight;    // factor of energy, gradient and Hessian
  alignas(64) Lane own = {};  // the square of epsilon is that much larger, if epsilon > 0
  // Output.
  alignas(64) Lane energy;       // +infinity where epsilon = 0 and det J <= 0
  alignas(64) Lane det;          // of J
  alignas(64) Lane gradient[9];  // gradient[3 a + i]: by component i of x_{a+1}; that by x0 is
                                 // minus their sum
  alignas(64) Lane block[6][9];  // second derivatives by x_{a+1} (row) and x_{b+1} (column), row-
                                 // major, for (a, b) = 00 01 02 11 12 22
};

// \param batch its energy and det are filled.
void element_values(ElementBatch& batch, const EnergyWeights& w);

// \param batch its energy, det and gradient are filled.
// \pre the energies are finite, here and below.
void element_gradients(ElementBatch& batch, const EnergyWeights& w);

// \param batch all is filled. The blocks are those of the Hessian of psi by vec(J) with its
//        negative eigenvalues multiplied by w.negative; they come in closed form from the singular
//        values (Smith, de Goes, Kim, ACM TOG 38(1), 2019).
void element_models(ElementBatch& batch, const EnergyWeights& w);

using Block3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// \param H factor times the second derivatives of one lane by all four corners: rows and columns
//        of the first are minus the sums of the others'.
inline void tet_blocks(const ElementBatch& batch, int lane, double factor, Block3 (&H)[4][4]) {
  int at = 0;
  for (int a = 1; a < 4; ++a)
    for (int b = a; b < 4; ++b, ++at) {
      for (int i = 0; i < 9; ++i) H[a][b](i / 3, i % 3) = factor * batch.block[at][i][lane];
      if (b > a) H[b][a] = H[a][b].transpose();
    }
  for (int a = 1; a < 4; ++a) {
    H[a][0] = -(H[a][1] + H[a][2] + H[a][3]);
    H[0][a] = H[a][0].transpose();
  }
  H[0][0] = -(H[0][1] + H[0][2] + H[0][3]);
}

}  // namespace stretchmap::volume
