// Functions of the six angles of a face's corners, to second order.
#pragma once

#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"

namespace stretchmap::area {

using Six = Eigen::Matrix<double, 6, 1>;
using SixSix = Eigen::Matrix<double, 6, 6>;

// A function of a face's six angles to second order.
struct Jet {
  double value = 0.0;
  Six gradient = Six::Zero();
  SixSix hessian = SixSix::Zero();
};

inline std::vector<TorusPoint> torus_points(const Torus& torus, const Points2Ref& angles) {
  const Index n = static_cast<Index>(angles.rows());
  std::vector<TorusPoint> points(static_cast<std::size_t>(n));
  for_rows(n, [&](Index i) { points[i] = torus.jet(angles(i, 0), angles(i, 1)); });
  return points;
}

// Area of the triangle in space. With e_k the edge opposite to corner k and N the unit normal:
// d/dp_k = 1/2 N x e_k, d2/dp_j dp_k = (e_j . e_k) N N' / (2 |n|) -+ 1/2 [N]x.
inline Jet area_jet(const TorusPoint (&p)[3], bool second) {
  Jet jet;
  Eigen::Vector3d e[3];
  for (int k = 0; k < 3; ++k) e[k] = p[(k + 2) % 3].point - p[(k + 1) % 3].point;
  const Eigen::Vector3d normal = e[0].cross(e[1]);
  const double length = normal.norm();
  jet.value = 0.5 * length;
  const Eigen::Vector3d unit = normal / length;
  Eigen::Matrix<double, 3, 2> cross[3];  // N x tangents
  Eigen::RowVector2d along[3];           // N . tangents
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d slope = 0.5 * unit.cross(e[k]);
    jet.gradient.segment<2>(2 * k) = p[k].tangent.transpose() * slope;
    if (!second) continue;
    jet.hessian.block<2, 2>(2 * k, 2 * k) = p[k].curvature(slope);
    along[k] = unit.transpose() * p[k].tangent;
    for (int c = 0; c < 2; ++c) cross[k].col(c) = unit.cross(p[k].tangent.col(c));
  }
  if (!second) return jet;
  for (int j = 0; j < 3; ++j)
    for (int k = 0; k < 3; ++k) {
      auto block = jet.hessian.block<2, 2>(2 * j, 2 * k);
      block += 0.5 * e[j].dot(e[k]) / length * along[j].transpose() * along[k];
      if (j != k) block -= (k == (j + 1) % 3 ? 0.5 : -0.5) * p[j].tangent.transpose() * cross[k];
    }
  return jet;
}

}  // namespace stretchmap::area
