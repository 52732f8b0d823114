// A point of the torus of area one by its two angles, to second order.
#pragma once

#include <cmath>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

struct TorusPoint {
  Eigen::Vector3d point;
  Eigen::Matrix<double, 3, 2> tangent;  // d/du, d/dv
  Eigen::Vector3d uu, uv, vv;           // second derivatives

  // Second derivative of the component along a fixed vector.
  Eigen::Matrix2d curvature(const Eigen::Vector3d& along) const {
    const double mixed = uv.dot(along);
    Eigen::Matrix2d matrix;
    matrix << uu.dot(along), mixed, mixed, vv.dot(along);
    return matrix;
  }
};

inline TorusPoint torus_point(double axis, double tube, double u, double v) {
  const double cu = std::cos(u), su = std::sin(u), cv = std::cos(v), sv = std::sin(v);
  const double w = axis + tube * cv;
  TorusPoint p;
  p.point << w * cu, w * su, tube * sv;
  p.tangent.col(0) << -w * su, w * cu, 0.0;
  p.tangent.col(1) << -tube * sv * cu, -tube * sv * su, tube * cv;
  p.uu << -w * cu, -w * su, 0.0;
  p.uv << tube * sv * su, -tube * sv * cu, 0.0;
  p.vv << -tube * cv * cu, -tube * cv * su, -tube * sv;
  return p;
}

// Of the torus of area one.
inline double tube_radius(double ratio) {
  return 1.0 / (6.283185307179586476925287 * std::sqrt(ratio));
}

inline std::vector<TorusPoint> torus_points(double ratio, const Points2Ref& angles) {
  const double tube = tube_radius(ratio);
  std::vector<TorusPoint> points(static_cast<std::size_t>(angles.rows()));
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < static_cast<Index>(angles.rows()); ++i)
    points[i] = torus_point(ratio * tube, tube, angles(i, 0), angles(i, 1));
  return points;
}

}  // namespace stretchmap::area
