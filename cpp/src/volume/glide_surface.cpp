#include "stretchmap/volume/glide_surface.hpp"

#include <cmath>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::volume {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

GlideSite GlideSurface::site(const Vector3d& x, Index hint, bool derivatives) const {
  GlideSite site;
  site.place = place(x, hint);
  site.outward = outward(x, site.place);
  if (!derivatives) return site;
  site.frame = frame(x, site.place);
  site.turn = outward_derivative(x, site.place);
  return site;
}

GlideSites sites_at(const GlideSurface& surface, const PointsRef& x,
                    const std::vector<Index>& vertices, const IndexVec& number, bool derivatives,
                    std::vector<Index>& places) {
  const Index count = static_cast<Index>(vertices.size());
  places.resize(vertices.size(), -1);
  GlideSites sites{number, std::vector<GlideSite>(vertices.size())};
  for_rows(count, kCostlyChunk, [&](Index i) {
    sites.at[i] = surface.site(x.row(vertices[i]).transpose(), places[i], derivatives);
    places[i] = sites.at[i].place;
  });
  return sites;
}

GlideSites sites_at(const GlideSurface& surface, const PointsRef& x,
                    const std::vector<Index>& vertices, const IndexVec& number, bool derivatives) {
  std::vector<Index> places;
  return sites_at(surface, x, vertices, number, derivatives, places);
}

namespace {

// Cosine and sine of the angle of (x, y).
struct Turn {
  double c, s;

  Turn(double x, double y) {
    const double length = std::sqrt(x * x + y * y);
    c = x / length;
    s = y / length;
  }
  // A little further.
  void add(double angle) {
    const double ca = std::cos(angle), sa = std::sin(angle), c0 = c;
    c = c0 * ca - s * sa;
    s = s * ca + c0 * sa;
  }
};

}  // namespace

TorusSurface::TorusSurface(double R, double r) : torus_{R, r} {}

Index TorusSurface::place(const Vector3d&, Index) const { return -1; }

Matrix3d TorusSurface::frame(const Vector3d& x, Index) const {
  const Turn u(x[0], x[1]), v(x.head<2>().norm() - torus_.R, x[2]);
  Matrix3d Q;
  Q.col(0) << -u.s, u.c, 0.0;
  Q.col(1) << -v.s * u.c, -v.s * u.s, v.c;
  Q.col(2) << v.c * u.c, v.c * u.s, v.s;
  return Q;
}

Vector3d TorusSurface::outward(const Vector3d& x, Index) const {
  const double share = 1.0 - torus_.R / x.head<2>().norm();
  return Vector3d(share * x[0], share * x[1], x[2]).normalized();
}

Matrix3d TorusSurface::outward_derivative(const Vector3d& x, Index) const {
  const double rho = x.head<2>().norm(), share = 1.0 - torus_.R / rho;
  const Vector3d along(-x[1] / rho, x[0] / rho, 0.0);
  const Vector3d off(share * x[0], share * x[1], x[2]);
  const double length = off.norm();
  const Vector3d n = off / length;
  return (Matrix3d::Identity() - n * n.transpose()) / length *
         (Matrix3d::Identity() - torus_.R / rho * along * along.transpose());
}

Vector3d TorusSurface::moved(const Vector3d& x, Index, const Vector2d& step) const {
  const double rho = x.head<2>().norm();
  Turn u(x[0], x[1]), v(rho - torus_.R, x[2]);
  u.add(step[0] / rho);
  v.add(step[1] / torus_.r);
  const double w = torus_.R + torus_.r * v.c;
  return {w * u.c, w * u.s, torus_.r * v.s};
}

// Of xi along arc length: uu is -radial / rho, vv is -normal / r, uv is -sin(v) e_u / rho, radial
// being cos(v) normal - sin(v) e_v.
Matrix2d TorusSurface::bending(const Vector3d& x, const GlideSite&, const Vector3d& g) const {
  const double rho = x.head<2>().norm();
  const double cv = (rho - torus_.R) / torus_.r, sv = x[2] / torus_.r;
  Matrix2d C;
  C(0, 0) = -(cv * g[2] - sv * g[1]) / rho;
  C(1, 1) = -g[2] / torus_.r;
  C(0, 1) = C(1, 0) = -sv * g[0] / rho;
  return C;
}

double TorusSurface::area() const { return torus_.area(); }

}  // namespace stretchmap::volume
