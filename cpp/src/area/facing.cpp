#include "area/facing.hpp"

#include <algorithm>
#include <limits>

#include "area/cross.hpp"

namespace stretchmap::area {

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d area_vector(const TorusPoint (&p)[3]) {
  return 0.5 * (p[1].point - p[0].point).cross(p[2].point - p[0].point);
}

// a' [n]x b for all pairs of columns.
Matrix2d mixed(const Eigen::Matrix<double, 3, 2>& a, const Vector3d& n,
               const Eigen::Matrix<double, 3, 2>& b) {
  Matrix2d m;
  for (int c = 0; c < 2; ++c) m.col(c) = a.transpose() * n.cross(b.col(c));
  return m;
}

// Whether the horizontal direction `way` lies strictly inside the interval of u of the corners.
bool inside(const TorusPoint (&p)[3], const Vector2d& way) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vector2d a = p[i].point.head<2>(), b = p[j].point.head<2>();
      if (cross(a, b) > 0.0 && cross(a, way) > 0.0 && cross(way, b) > 0.0) return true;
    }
  return false;
}

// A . w for a vector w that does not move, added to the jet times a factor.
void add_component(const TorusPoint (&p)[3], const Vector3d& w, double factor, bool second,
                   Jet& jet) {
  for (int i = 0; i < 3; ++i) {
    const Vector3d by_point = 0.5 * factor * (p[(i + 1) % 3].point - p[(i + 2) % 3].point).cross(w);
    jet.gradient.segment<2>(2 * i) += p[i].tangent.transpose() * by_point;
    if (!second) continue;
    jet.hessian.block<2, 2>(2 * i, 2 * i) += p[i].curvature(by_point);
    const int j = (i + 1) % 3;
    const Matrix2d block = 0.5 * factor * mixed(p[i].tangent, -w, p[j].tangent);
    jet.hessian.block<2, 2>(2 * i, 2 * j) += block;
    jet.hessian.block<2, 2>(2 * j, 2 * i) += block.transpose();
  }
}

// Where the face looks outward least inside its interval of u: (A . p - R |A_flat|) / r.
Jet inner_facing(const TorusPoint (&p)[3], const Vector3d& area, const Torus& torus, bool second) {
  Jet jet;
  Vector3d way(area.x(), area.y(), 0.0);
  const double flat = way.norm();
  way /= flat;
  jet.value = (area.dot(p[0].point) - torus.R * flat) / torus.r;
  add_component(p, way, -torus.R / torus.r, second, jet);
  // A . p is half the determinant of the corners.
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const Vector3d by_point = 0.5 / torus.r * p[j].point.cross(p[k].point);
    jet.gradient.segment<2>(2 * i) += p[i].tangent.transpose() * by_point;
    if (!second) continue;
    jet.hessian.block<2, 2>(2 * i, 2 * i) += p[i].curvature(by_point);
    const Matrix2d block = -0.5 / torus.r * mixed(p[i].tangent, p[k].point, p[j].tangent);
    jet.hessian.block<2, 2>(2 * i, 2 * j) += block;
    jet.hessian.block<2, 2>(2 * j, 2 * i) += block.transpose();
  }
  if (!second) return jet;
  Jet sideways;  // the change of |A_flat| by the turning of A_flat
  add_component(p, Vector3d(-way.y(), way.x(), 0.0), 1.0, false, sideways);
  jet.hessian -= torus.R / (torus.r * flat) * sideways.gradient * sideways.gradient.transpose();
  return jet;
}

}  // namespace

Jet corner_facing(const TorusPoint (&p)[3], int k, bool second) {
  const Vector3d area = area_vector(p);
  const Vector3d normal = p[k].tangent.col(0).cross(p[k].tangent.col(1)).normalized();
  Jet jet;
  jet.value = area.dot(normal);
  add_component(p, normal, 1.0, second, jet);
  // Along a principal circle the normal turns by its normal curvature times the tangent.
  const double bend_u = -p[k].uu.dot(normal) / p[k].tangent.col(0).squaredNorm();
  const double bend_v = -p[k].vv.dot(normal) / p[k].tangent.col(1).squaredNorm();
  Eigen::Matrix<double, 3, 2> turn;
  turn << bend_u * p[k].tangent.col(0), bend_v * p[k].tangent.col(1);
  jet.gradient.segment<2>(2 * k) += turn.transpose() * area;
  if (!second) return jet;
  for (int i = 0; i < 3; ++i) {
    const Vector3d edge = 0.5 * (p[(i + 1) % 3].point - p[(i + 2) % 3].point);
    const Matrix2d block = mixed(p[i].tangent, edge, turn);
    jet.hessian.block<2, 2>(2 * i, 2 * k) += block;
    jet.hessian.block<2, 2>(2 * k, 2 * i) += block.transpose();
  }
  // Second derivatives of the normal: those of the point of a tube of radius one on a circle of
  // radius nought.
  Matrix2d own;
  own(0, 0) = bend_u * area.dot(p[k].uu);
  own(0, 1) = own(1, 0) = bend_v * area.dot(p[k].uv);
  own(1, 1) = -area.dot(normal);
  jet.hessian.block<2, 2>(2 * k, 2 * k) += own;
  return jet;
}

double least_facing(const TorusPoint (&p)[3], const Torus& torus) {
  const Vector3d area = area_vector(p);
  if (inside(p, area.head<2>()))
    return (area.dot(p[0].point) - torus.R * area.head<2>().norm()) / torus.r;
  double least = std::numeric_limits<double>::infinity();
  for (const TorusPoint& corner : p)
    least =
        std::min(least, area.dot(corner.tangent.col(0).cross(corner.tangent.col(1)).normalized()));
  return least;
}

Facing facing(const TorusPoint (&p)[3], const Torus& torus, bool second) {
  Facing result{
      {corner_facing(p, 0, second), corner_facing(p, 1, second), corner_facing(p, 2, second)}, {}};
  const Vector3d area = area_vector(p);
  if (inside(p, area.head<2>()))
    result.least = inner_facing(p, area, torus, second);
  else
    result.least = *std::min_element(result.corner, result.corner + 3,
                                     [](const Jet& a, const Jet& b) { return a.value < b.value; });
  return result;
}

}  // namespace stretchmap::area
