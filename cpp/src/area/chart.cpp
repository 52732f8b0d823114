#include "stretchmap/area/chart.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "area/cross.hpp"
#include "stretchmap/area/line_roots.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"

namespace stretchmap::area {

SurfaceChart surface_chart(const mesh::SurfaceTopology& top, const IndexRows& forms) {
  if (forms.rows() != 2 || forms.cols() != top.edges.rows())
    throw Error("ArrayError", "the chart needs two 1-forms with one number per edge");
  const Index m = static_cast<Index>(top.faces.rows());
  SurfaceChart chart{top.n_vertices, top.faces, Faces::Zero(m, 3), Faces::Zero(m, 3)};
  std::vector<Index> open;
  for (int c = 0; c < 2; ++c) {
    Faces& shift = c == 0 ? chart.shift_u : chart.shift_v;
    for (Index f = 0; f < m; ++f) {
      Index along[3];
      for (int k = 0; k < 3; ++k) {
        const Index h = 3 * f + k;
        along[k] = static_cast<Index>(top.sign(h)) * forms(c, top.edge(h));
      }
      if (along[0] + along[1] + along[2] != 0) open.push_back(f);
      shift(f, 1) = along[0];
      shift(f, 2) = along[0] + along[1];
    }
  }
  if (!open.empty()) throw Error("SolverError", "a coordinate 1-form is not closed", open);
  return chart;
}

Vec turn_areas(const SurfaceChart& chart, const Points2Ref& turns) {
  Vec areas(chart.faces.rows());
  for_rows(static_cast<Index>(areas.size()), [&](Index f) {
    const Eigen::Vector2d p = chart.corner(turns, f, 0);
    const Eigen::Vector2d a = chart.corner(turns, f, 1) - p;
    const Eigen::Vector2d b = chart.corner(turns, f, 2) - p;
    areas(f) = 0.5 * cross(a, b);
  });
  return areas;
}

std::vector<Index> folded_faces(const SurfaceChart& chart, const Points2Ref& turns) {
  const Vec areas = turn_areas(chart, turns);
  std::vector<Index> faces;
  for (Index f = 0; f < areas.size(); ++f)
    if (!(areas(f) > 0.0)) faces.push_back(f);
  return faces;
}

Vec unfolded_steps(const SurfaceChart& chart, const Points2Ref& turns,
                   const Points2Ref& direction) {
  Vec steps(chart.faces.rows());
  for_rows(static_cast<Index>(steps.size()), [&](Index f) {
    const Eigen::Vector2d p = chart.corner(turns, f, 0);
    const Eigen::Vector2d a = chart.corner(turns, f, 1) - p, b = chart.corner(turns, f, 2) - p;
    const auto way = [&](int k) -> Eigen::Vector2d {
      return (direction.row(chart.faces(f, k)) - direction.row(chart.faces(f, 0))).transpose();
    };
    const Eigen::Vector2d da = way(1), db = way(2);
    const double now = cross(a, b), linear = cross(da, b) + cross(a, db);
    steps(f) = now > 0.0 ? first_root(now, linear, cross(da, db))
                         : std::numeric_limits<double>::infinity();
  });
  return steps;
}

double unfolded_step(const SurfaceChart& chart, const Points2Ref& turns,
                     const Points2Ref& direction, double share, double longest) {
  return std::min(share * unfolded_steps(chart, turns, direction).minCoeff(), longest);
}

Vec equal_area_from_angle(const VecRef& v, double tube_ratio) {
  return v.array() + tube_ratio * v.array().sin();
}

double equal_area_angle(double s, double tube_ratio, double guess) {
  double low = -0.5 * kTwoPi, high = 0.5 * kTwoPi, x = guess;
  for (int iteration = 0; iteration < 80; ++iteration) {
    const double residual = x + tube_ratio * std::sin(x) - s;
    (residual > 0.0 ? high : low) = x;
    double next = x - residual / (1.0 + tube_ratio * std::cos(x));
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double change = std::abs(next - x);
    x = next;
    if (change <= 4e-16 * (1.0 + std::abs(x))) break;
  }
  return x;
}

Vec angle_from_equal_area(const VecRef& s, double tube_ratio) {
  Vec v(s.size());
  for_rows(static_cast<Index>(s.size()), kElementChunk, [&](Index i) {
    const double whole = kTwoPi * std::round(s(i) / kTwoPi);
    const double t = s(i) - whole;
    v(i) = equal_area_angle(t, tube_ratio, t / (1.0 + tube_ratio)) + whole;
  });
  return v;
}

}  // namespace stretchmap::area
