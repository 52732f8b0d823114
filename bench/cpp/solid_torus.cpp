#include "solid_torus.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "stretchmap/mesh/size.hpp"

namespace stretchmap::bench {
namespace {

const double kTwoPi = 2.0 * std::acos(-1.0);

struct Disk {
  Points2 points;  // in the unit disk
  Points2 polar;   // radius, angle in turns
  Faces faces;     // counter-clockwise
};

Index first_of_ring(Index k) { return k == 0 ? 0 : 1 + 3 * k * (k - 1); }

// Ring k of n has 6 k vertices.
Disk disk(Index n) {
  Disk d;
  const Index size = first_of_ring(n + 1);
  d.points.resize(size, 2);
  d.polar.resize(size, 2);
  for (Index k = 0; k <= n; ++k) {
    for (Index j = 0; j < std::max<Index>(6 * k, 1); ++j) {
      const double radius = double(k) / n, turn = k == 0 ? 0.0 : double(j) / (6 * k);
      const Index i = first_of_ring(k) + j;
      d.polar.row(i) << radius, turn;
      d.points.row(i) << radius * std::cos(kTwoPi * turn), radius * std::sin(kTwoPi * turn);
    }
  }
  std::vector<Index> ids;
  for (Index k = 1; k <= n; ++k) {
    const Index outer = 6 * k, inner = std::max<Index>(6 * (k - 1), 1);
    const auto on = [&](Index ring, Index count, Index j) {
      return first_of_ring(ring) + j % count;
    };
    for (Index sector = 0; sector < 6; ++sector) {
      for (Index j = 0; j < k; ++j) {
        const Index o = sector * k + j, i = sector * (k - 1) + j;
        ids.insert(ids.end(), {on(k - 1, inner, i), on(k, outer, o), on(k, outer, o + 1)});
        if (j + 1 < k)
          ids.insert(ids.end(),
                     {on(k - 1, inner, i), on(k, outer, o + 1), on(k - 1, inner, i + 1)});
      }
    }
  }
  d.faces = Eigen::Map<const Faces>(ids.data(), static_cast<Index>(ids.size() / 3), 3);
  return d;
}

// Three tets per prism, cut from the lowest to the highest vertex number of the disk so that
// neighbors agree.
void add_prism(std::array<Index, 3> corner, Index here, Index there, Tets& tets, Index& t) {
  std::sort(corner.begin(), corner.end());
  const auto [a, b, c] = corner;
  tets.row(t++) << here + a, here + b, here + c, there + c;
  tets.row(t++) << here + a, here + b, there + b, there + c;
  tets.row(t++) << here + a, there + a, there + b, there + c;
}

}  // namespace

SolidTorus solid_torus(Index n_tets) {
  SolidTorus s;
  // 18 n^2 m tets, cells about as long (around the axis) as wide.
  const double slenderness = kTwoPi * s.R / s.r;
  const Index n = std::max<Index>(1, std::lround(std::cbrt(n_tets / (18.0 * slenderness))));
  const Index m = std::max<Index>(6, std::lround(n_tets / (18.0 * n * n)));
  const Disk d = disk(n);
  const Index size = static_cast<Index>(d.points.rows());
  s.points.resize(size * m, 3);
  s.standard.resize(size * m, 3);
  s.turns.resize(size * m, 2);
  for (Index i = 0; i < m; ++i) {
    const double u = double(i) / m, cosine = std::cos(kTwoPi * u), sine = std::sin(kTwoPi * u);
    const double tube = s.r * (1.0 + 0.25 * std::cos(2.0 * kTwoPi * u));
    const double bend = 0.3 * std::sin(3.0 * kTwoPi * u);
    for (Index p = 0; p < size; ++p) {
      const auto place = [&](double radius, double lift) -> Eigen::RowVector3d {
        const double across = s.R + radius * d.points(p, 0);
        return {across * cosine, across * sine, radius * d.points(p, 1) + lift};
      };
      s.points.row(i * size + p) = place(tube, bend);
      s.standard.row(i * size + p) = place(s.r, 0.0);
      s.turns.row(i * size + p) << u, d.polar(p, 1);
    }
  }
  s.tets.resize(static_cast<Index>(3 * d.faces.rows()) * m, 4);
  Index t = 0;
  for (Index i = 0; i < m; ++i)
    for (Index f = 0; f < d.faces.rows(); ++f)
      add_prism({d.faces(f, 0), d.faces(f, 1), d.faces(f, 2)}, i * size, (i + 1) % m * size, s.tets,
                t);
  const Vec volumes = mesh::tet_volumes(s.points, s.tets);
  for (Index k = 0; k < s.tets.rows(); ++k)
    if (volumes[k] < 0.0) std::swap(s.tets(k, 2), s.tets(k, 3));
  const double scale =
      std::cbrt(volumes.cwiseAbs().sum() / mesh::tet_volumes(s.standard, s.tets).sum());
  s.standard *= scale;
  s.R *= scale;
  s.r *= scale;
  return s;
}

}  // namespace stretchmap::bench
