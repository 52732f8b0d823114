// Distortion of a triangle between two flat charts, as a function of its Jacobian K:
//
//   phi(K) = shape (tr(K^T K) / (2 det K) - 1) + area (det K + 1 / det K - 2),
//
// zero at rotations, and a barrier against folding.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

using Matrix4 = Eigen::Matrix<double, 4, 4>;

struct TriangleWeights {
  double shape = 1.0;
  double area = 0.5;
};

// \return phi(K), +infinity when det K <= 0.
double triangle_value(const Eigen::Matrix2d& K, const TriangleWeights& weights = {});

// \param P,H gradient and Hessian with respect to vec(K) (column-major), the latter with its
//        negative eigenvalues set to zero.
// \pre det K > 0.
void triangle_model(const Eigen::Matrix2d& K, Eigen::Matrix2d& P, Matrix4& H,
                    const TriangleWeights& weights = {});

}  // namespace stretchmap::area
