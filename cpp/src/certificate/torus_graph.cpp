#include "stretchmap/certificate/torus_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"

namespace stretchmap::certificate {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

double cross(const Vec2& a, const Vec2& b) { return a[0] * b[1] - a[1] * b[0]; }

struct FaceOnTorus {
  bool proven = false;
  double chart_area = 0.0;  // of the straight triangle between the lifted corners
};

// A direction less than a right angle from all three, zero if there is none: the mean, or the
// middle between two of them where these are far from the third.
Vec2 middle_of(const std::array<Vec2, 3>& unit, bool strict) {
  for (const Vec2& middle : {Vec2(unit[0] + unit[1] + unit[2]), Vec2(unit[0] + unit[1]),
                             Vec2(unit[1] + unit[2]), Vec2(unit[2] + unit[0])}) {
    const auto near = [&](const Vec2& direction) { return middle.dot(direction) > 1e-9; };
    if (std::all_of(unit.begin(), unit.end(), near)) return middle;
    if (strict) break;
  }
  return Vec2::Zero();
}

FaceOnTorus examine(const std::array<Vec3, 3>& x, double R, bool strict) {
  FaceOnTorus out;
  // All corners on one side of a plane through the axis, so u is an interval shorter than pi.
  std::array<Vec2, 3> flat, unit;
  for (int k = 0; k < 3; ++k) {
    flat[k] = x[k].head<2>();
    unit[k] = flat[k].normalized();
  }
  const Vec2 middle = middle_of(unit, strict);
  if (middle.isZero(0.0)) return out;
  const Vec3 e1 = x[1] - x[0], e2 = x[2] - x[0];
  const Vec3 n = e1.cross(e2);
  const Vec2 n_flat = n.head<2>();

  // Largest n . c(x) / R over the face: at an end of the interval of u, or inside it.
  std::array<double, 3> u;
  double reach = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    u[k] = std::atan2(cross(middle, flat[k]), middle.dot(flat[k]));
    reach = std::max(reach, n_flat.dot(unit[k]));
  }
  const auto [low, high] = std::minmax({u[0], u[1], u[2]});
  const double towards = std::atan2(cross(middle, n_flat), middle.dot(n_flat));
  if (towards > low - 1e-9 && towards < high + 1e-9) reach = n_flat.norm();

  // Rounding: with the unit u = 2^-53 the computed normal is off by less than 9 u |e1| |e2|, hence
  // n . x by less than 12 u |e1| |e2| |x| and `reach` by less than 16 u |e1| |e2|, to which comes
  // at most 27 u |e1| |e2| where n_flat is so short that its direction is lost. Together below 64
  // u.
  const double size = std::max({x[0].norm(), x[1].norm(), x[2].norm()}) + R;
  const double bound =
      32.0 * std::numeric_limits<double>::epsilon() * e1.norm() * e2.norm() * size + 1e-300;
  out.proven = n.dot(x[0]) - R * reach > bound;

  // v lies within a quarter turn of the normal's own direction in the half-plane of u, which turns
  // by less than a half turn over the face; this gives the branch of v at every corner.
  std::array<double, 3> v;
  for (int k = 0; k < 3; ++k) {
    const double facing = std::atan2(n[2], n_flat.dot(unit[k]));
    const double angle = std::atan2(x[k][2], flat[k].norm() - R);
    v[k] = facing + std::remainder(angle - facing, kTwoPi);
  }
  out.chart_area = 0.5 * ((u[1] - u[0]) * (v[2] - v[0]) - (v[1] - v[0]) * (u[2] - u[0]));
  return out;
}

}  // namespace

TorusGraph torus_graph(const PointsRef& points, const FacesRef& faces, double R, bool strict) {
  std::vector<FaceOnTorus> examined(static_cast<std::size_t>(faces.rows()));
  for_rows(static_cast<Index>(faces.rows()), kCostlyChunk, [&](Index f) {
    examined[f] = examine(
        {points.row(faces(f, 0)), points.row(faces(f, 1)), points.row(faces(f, 2))}, R, strict);
  });
  std::vector<Index> bad;
  double area = 0.0;
  for (Index f = 0; f < static_cast<Index>(faces.rows()); ++f) {
    area += examined[f].chart_area;
    if (!examined[f].proven) bad.push_back(f);
  }
  TorusGraph out;
  out.winding = bad.empty() ? area / (4.0 * kPi * kPi) : std::numeric_limits<double>::quiet_NaN();
  out.bad = Eigen::Map<IndexVec>(bad.data(), static_cast<Eigen::Index>(bad.size()));
  return out;
}

}  // namespace stretchmap::certificate
