// The standard torus, and the only place where it is parametrized.
#pragma once

#include <cmath>

#include "stretchmap/base/types.hpp"

namespace stretchmap {

inline constexpr double kPi = static_cast<double>(EIGEN_PI);
inline constexpr double kTwoPi = 2.0 * kPi;

// A point of a torus and its derivatives by the two angles.
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

// xi(u, v) = ((R + r cos v) cos u, (R + r cos v) sin u, r sin v), (7.1) at s = r. \pre 0 < r < R.
struct Torus {
  double R, r;

  // \param ratio R / r > 1.
  static Torus of_area_one(double ratio) {
    const double r = 1.0 / (kTwoPi * std::sqrt(ratio));
    return {ratio * r, r};
  }

  double area() const { return static_cast<double>(4.0 * EIGEN_PI * EIGEN_PI * R * r); }

  Eigen::Vector3d point(double u, double v) const {
    const double w = R + r * std::cos(v);
    return {w * std::cos(u), w * std::sin(u), r * std::sin(v)};
  }

  TorusPoint jet(double u, double v) const {
    const double cu = std::cos(u), su = std::sin(u), cv = std::cos(v), sv = std::sin(v);
    const double w = R + r * cv;
    TorusPoint p;
    p.point << w * cu, w * su, r * sv;
    p.tangent.col(0) << -w * su, w * cu, 0.0;
    p.tangent.col(1) << -r * sv * cu, -r * sv * su, r * cv;
    p.uu << -w * cu, -w * su, 0.0;
    p.uv << r * sv * su, -r * sv * cu, 0.0;
    p.vv << -r * cv * cu, -r * cv * su, -r * sv;
    return p;
  }
};

}  // namespace stretchmap
