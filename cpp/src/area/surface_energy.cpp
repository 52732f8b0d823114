#include "stretchmap/area/surface_energy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "area/convex_faces.hpp"
#include "area/face_jet.hpp"
#include "area/facing.hpp"
#include "stretchmap/area/surface_pattern.hpp"
#include "stretchmap/base/parallel.hpp"

namespace stretchmap::area {

namespace {

// Share of its own area up to which a face has to look outward for the barrier to leave it alone:
// of the faces of a map that is nearly done few have less.
constexpr double kFacing = 0.5;

// Sum of half the cotangent times the squared opposite edge: |t| (s1^2 + s2^2).
Jet dirichlet_jet(const TorusPoint (&p)[3], const Eigen::Vector3d& cotan, bool second) {
  Jet jet;
  for (int k = 0; k < 3; ++k) {
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    const Eigen::Vector3d e = p[b].point - p[a].point;
    jet.value += 0.5 * cotan(k) * e.squaredNorm();
    jet.gradient.segment<2>(2 * a) -= cotan(k) * p[a].tangent.transpose() * e;
    jet.gradient.segment<2>(2 * b) += cotan(k) * p[b].tangent.transpose() * e;
    if (!second) continue;
    jet.hessian.block<2, 2>(2 * a, 2 * a) +=
        cotan(k) * (p[a].tangent.transpose() * p[a].tangent - p[a].curvature(e));
    jet.hessian.block<2, 2>(2 * b, 2 * b) +=
        cotan(k) * (p[b].tangent.transpose() * p[b].tangent + p[b].curvature(e));
    const Eigen::Matrix2d mixed = cotan(k) * p[a].tangent.transpose() * p[b].tangent;
    jet.hessian.block<2, 2>(2 * a, 2 * b) -= mixed;
    jet.hessian.block<2, 2>(2 * b, 2 * a) -= mixed.transpose();
  }
  return jet;
}

// Area in the (u, v) chart times the density of the torus at the mean v, as a share of its area.
Jet chart_jet(const Eigen::Vector2d (&angle)[3], double tube_ratio, bool second) {
  constexpr double kShare = 0.5 / (4.0 * 9.869604401089358618834491);  // 1/2 over (2 pi)^2
  const Eigen::Vector2d a = angle[1] - angle[0], b = angle[2] - angle[0];
  const double flat = kShare * (a.x() * b.y() - a.y() * b.x());
  const double v = (angle[0].y() + angle[1].y() + angle[2].y()) / 3.0;
  const double density = 1.0 + tube_ratio * std::cos(v);
  const double slope = -tube_ratio * std::sin(v) / 3.0;  // of the density by each v
  const double bend = -tube_ratio * std::cos(v) / 9.0;
  Jet jet;
  jet.value = flat * density;
  Six by_flat, by_v;  // gradients of the flat area and of the density over its slope
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector2d e = angle[(k + 2) % 3] - angle[(k + 1) % 3];
    by_flat.segment<2>(2 * k) << -kShare * e.y(), kShare * e.x();
    by_v.segment<2>(2 * k) << 0.0, 1.0;
  }
  jet.gradient = density * by_flat + flat * slope * by_v;
  if (!second) return jet;
  const SixSix mixed = slope * by_flat * by_v.transpose();
  jet.hessian = mixed + mixed.transpose() + flat * bend * by_v * by_v.transpose();
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3;
    const double entry = kShare * density;
    jet.hessian(2 * k, 2 * l + 1) += entry;
    jet.hessian(2 * l + 1, 2 * k) += entry;
    jet.hessian(2 * k + 1, 2 * l) -= entry;
    jet.hessian(2 * l, 2 * k + 1) -= entry;
  }
  return jet;
}

// Adds weight (x + 1/x - 2), x = jet / unit.
void add_barrier(const Jet& jet, double unit, double weight, bool second, Jet& sum) {
  const double x = jet.value / unit;
  sum.value += weight * (x - 1.0) * (x - 1.0) / x;
  const double slope = weight * (1.0 - 1.0 / (x * x)) / unit;
  sum.gradient += slope * jet.gradient;
  if (!second) return;
  const double bend = weight * 2.0 / (x * x * x * unit * unit);
  sum.hessian += bend * jet.gradient * jet.gradient.transpose() + slope * jet.hessian;
}

// Adds weight (x - 1/x)^2 / 4, x = jet / unit: grows as fast as what the standard deviation counts.
// `curvature` multiplies the jet's own second derivatives: 1 is exact, 0 Gauss-Newton.
void add_areas(const Jet& jet, double unit, double weight, double curvature, bool second,
               Jet& sum) {
  const double x = jet.value / unit, q = 1.0 / x;
  sum.value += 0.25 * weight * (x - q) * (x - q);
  const double slope = 0.5 * weight * (x - q * q * q) / unit;
  sum.gradient += slope * jet.gradient;
  if (!second) return;
  const double bend = 0.5 * weight * (1.0 + 3.0 * q * q * q * q) / (unit * unit);
  sum.hessian += bend * jet.gradient * jet.gradient.transpose() + curvature * slope * jet.hessian;
}

// Adds weight ((x^2 + 1) / chi(x) - 2), x = jet / unit: finite where a face looks inward as long as
// epsilon > 0.
void add_facing(const Jet& jet, double unit, double weight, double epsilon, bool second, Jet& sum) {
  const double x = jet.value / unit;
  const double root = std::sqrt(x * x + epsilon * epsilon);
  const double chi = epsilon <= 0.0 ? x
                     : x >= 0.0     ? 0.5 * (x + root)
                                    : 0.5 * epsilon * epsilon / (root - x);
  const double rate = epsilon <= 0.0 ? 1.0 : chi / root;  // d chi / dx
  const double q = 1.0 / chi, t = rate * q;
  sum.value += weight * ((x * x + 1.0) * q - 2.0);
  const double slope = weight * q * (2.0 * x - (x * x + 1.0) * t) / unit;
  sum.gradient += slope * jet.gradient;
  if (!second) return;
  const double bend = 2.0 * weight * q * ((1.0 - x * t) * (1.0 - x * t) + t * t) / (unit * unit);
  sum.hessian += bend * jet.gradient * jet.gradient.transpose();
  if (epsilon < 0.2) sum.hessian += slope * jet.hessian;
}

// Adds weight (d / (2 a) - 1).
void add_shape(const Jet& d, const Jet& a, double weight, bool second, Jet& sum) {
  const double q = 0.5 * d.value / a.value;
  sum.value += weight * (q - 1.0);
  const double by_d = 0.5 * weight / a.value, by_a = -weight * q / a.value;
  sum.gradient += by_d * d.gradient + by_a * a.gradient;
  if (!second) return;
  const SixSix mixed = (-by_d / a.value) * d.gradient * a.gradient.transpose();
  sum.hessian += by_d * d.hessian + by_a * a.hessian + mixed + mixed.transpose() -
                 (2.0 * by_a / a.value) * a.gradient * a.gradient.transpose();
}

Jet face_energy(const GlideProblem& problem, const SurfaceWeights& weights, double scale,
                const std::vector<TorusPoint>& points, const Points2Ref& angles, Index f,
                bool second, double curvature) {
  TorusPoint p[3];
  Eigen::Vector2d angle[3];
  for (int k = 0; k < 3; ++k) {
    const Index i = problem.chart.faces(f, k);
    p[k] = points[i];
    angle[k] << angles(i, 0) + kTwoPi * problem.chart.shift_u(f, k),
        angles(i, 1) + kTwoPi * problem.chart.shift_v(f, k);
  }
  const double size = problem.reference.areas(f), share = problem.reference.weights(f);
  Jet sum;
  const Jet chart = chart_jet(angle, 1.0 / problem.ratio, second);
  const Jet area = area_jet(p, second);
  if (!(chart.value > 0.0 && area.value > 0.0)) {
    sum.value = std::numeric_limits<double>::infinity();
    return sum;
  }
  add_areas(area, scale * size, weights.area * share, curvature, second, sum);
  if (weights.chart > 0.0) add_barrier(chart, size, weights.chart * share, second, sum);
  if (weights.facing > 0.0) {
    const double least = least_facing(p, problem.torus());
    if (weights.epsilon <= 0.0 && !(least > 0.0)) {
      sum.value = std::numeric_limits<double>::infinity();
      return sum;
    }
    if (weights.epsilon > 0.0 || least < kFacing * size) {
      const Facing outward = facing(p, problem.torus(), second);
      const double weight = 0.25 * weights.facing * share;
      const auto add = [&](const Jet& jet) {
        if (weights.epsilon > 0.0)
          add_facing(jet, size, weight, weights.epsilon, second, sum);
        else if (jet.value < kFacing * size)
          add_facing(jet, kFacing * size, weight, 0.0, second, sum);
      };
      add(outward.least);
      for (const Jet& corner : outward.corner) add(corner);
    }
  }
  if (weights.shape > 0.0)
    add_shape(dirichlet_jet(p, problem.reference.cotan.row(f), second), area, weights.shape * share,
              second, sum);
  return sum;
}

}  // namespace

GlideEnergy glide_energy(const GlideProblem& problem, const SurfaceWeights& weights, double scale,
                         const Points2Ref& angles, Derivatives derivatives, double curvature) {
  const Index m = static_cast<Index>(problem.chart.faces.rows());
  const bool second = derivatives != Derivatives::kNone;
  if (derivatives != Derivatives::kModel) curvature = 1.0;
  const std::vector<TorusPoint> points = torus_points(problem.torus(), angles);
  Vec values(m);
  Rows gradients(second ? m : 0, 6);
  GlideEnergy energy;
  if (second) energy.hessians.resize(m, 36);
  for_chunks(m, kCostlyChunk, [&](Index begin, Index end) {
    for (Index f = begin; f < end; ++f) {
      const Jet jet = face_energy(problem, weights, scale, points, angles, f, second, curvature);
      values(f) = jet.value;
      if (!second) continue;
      gradients.row(f) = jet.gradient;
      Eigen::Map<SixSix>(energy.hessians.row(f).data()) = jet.hessian;
    }
    if (derivatives == Derivatives::kModel) make_convex(energy.hessians, begin, end);
  });
  energy.value = values.sum();
  if (second)
    energy.gradient = sum_corners(problem.chart.faces, problem.chart.n_vertices, gradients);
  return energy;
}

Points glide_image(const GlideProblem& problem, const Points2Ref& angles) {
  const std::vector<TorusPoint> points = torus_points(problem.torus(), angles);
  Points image(angles.rows(), 3);
  for_rows(static_cast<Index>(image.rows()), [&](Index i) { image.row(i) = points[i].point; });
  return image;
}

Vec least_facing(const GlideProblem& problem, const Points2Ref& angles) {
  const std::vector<TorusPoint> points = torus_points(problem.torus(), angles);
  const Torus torus = problem.torus();
  Vec least(problem.chart.faces.rows());
  for_rows(static_cast<Index>(least.size()), kElementChunk, [&](Index f) {
    TorusPoint p[3];
    for (int k = 0; k < 3; ++k) p[k] = points[problem.chart.faces(f, k)];
    least(f) = least_facing(p, torus) / problem.reference.areas(f);
  });
  return least;
}

Vec glide_areas(const GlideProblem& problem, const Points2Ref& angles) {
  const std::vector<TorusPoint> points = torus_points(problem.torus(), angles);
  Vec areas(problem.chart.faces.rows());
  for_rows(static_cast<Index>(areas.size()), [&](Index f) {
    const Eigen::Vector3d p = points[problem.chart.faces(f, 0)].point;
    const Eigen::Vector3d a = points[problem.chart.faces(f, 1)].point - p;
    const Eigen::Vector3d b = points[problem.chart.faces(f, 2)].point - p;
    areas(f) = 0.5 * a.cross(b).norm();
  });
  return areas;
}

double best_scale(const GlideProblem& problem, const Points2Ref& angles) {
  const Vec areas = glide_areas(problem, angles);
  const Eigen::ArrayXd ratio = areas.array() / problem.reference.areas.array();
  const Eigen::ArrayXd weights = problem.reference.weights.array();
  return std::sqrt(std::sqrt((weights * ratio.square()).sum() / (weights / ratio.square()).sum()));
}

}  // namespace stretchmap::area
