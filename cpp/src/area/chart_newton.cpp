#include "stretchmap/area/chart_newton.hpp"

#include <cmath>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/linalg/backtrack.hpp"

namespace stretchmap::area {

namespace {

using Eigen::Matrix2d;

constexpr int kChartTries = 30;
constexpr double kHoldTranslation = 1e-12;  // of the mean diagonal: holds the two translations

// Inverse edge matrices of triangles given by their areas and cotangents.
Rows rest_of(const SurfaceReference& reference) {
  Rows rest(reference.areas.size(), 4);
  for (Index f = 0; f < static_cast<Index>(rest.rows()); ++f) {
    const double twice = 2.0 * reference.areas(f);
    const double base = std::sqrt(twice * (reference.cotan(f, 0) + reference.cotan(f, 1)));
    const double height = twice / base;
    // Of [[base, height cot], [0, height]].
    rest.row(f) << 1.0 / base, -reference.cotan(f, 0) / base, 0.0, 1.0 / height;
  }
  return rest;
}

}  // namespace

ChartNewton::ChartNewton(SurfaceChart chart, SurfaceReference reference, double aspect,
                         Points2 turns)
    : chart_(std::move(chart)),
      reference_(std::move(reference)),
      periods_(std::sqrt(aspect), 1.0 / std::sqrt(aspect)),
      turns_(std::move(turns)),
      rest_(rest_of(reference_)),
      system_(chart_.faces, chart_.n_vertices, kHoldTranslation) {
  const std::vector<Index> faces = folded_faces(chart_, turns_);
  if (!faces.empty())
    throw Error("SolverError", "faces are folded in the chart; Newton steps need a start without",
                faces);
}

ChartNewton::Targets ChartNewton::targets(double reach) const {
  const Vec image = turn_areas(chart_, turns_);
  const Eigen::ArrayXd ratio = image.array() / reference_.areas.array();
  // Over the source's area: the ratio itself, brought within `reach` of one step from 1.
  const Eigen::ArrayXd next = ratio * ratio.inverse().min(reach).max(1.0 / reach);
  const double each = 1.0 / static_cast<double>(image.size());
  const Eigen::ArrayXd evened = each * (reference_.areas.array() / each).pow(1.0 / 3.0);
  return {next, 0.5 * (image.array() + evened)};
}

Matrix2d ChartNewton::rest(const Targets& targets, Index f) const {
  Matrix2d inverse;
  inverse << rest_(f, 0), rest_(f, 1), rest_(f, 2), rest_(f, 3);
  return inverse / std::sqrt(targets.areas(f));
}

Matrix2d ChartNewton::jacobian(const Points2& turns, const Targets& targets, Index f) const {
  return periods_.asDiagonal() * chart_.edges(turns, f) * rest(targets, f);
}

double ChartNewton::value(const Points2& turns, const TriangleWeights& weights,
                          const Targets& targets) const {
  Vec values(targets.areas.size());
  for_rows(static_cast<Index>(values.size()), kElementChunk, [&](Index f) {
    values(f) = targets.weights(f) * triangle_value(jacobian(turns, targets, f), weights);
  });
  return values.sum();
}

ChartStep ChartNewton::step(const TriangleWeights& weights, double reach, const Poll& poll) {
  const Targets goal = targets(reach);
  const Index m = static_cast<Index>(goal.areas.size());
  ChartStep result;
  for (Index f = 0; f < m; ++f)
    if (std::abs(goal.areas(f) - 1.0) < 1e-9) result.within += reference_.areas(f);
  Rows gradients(m, 6), hessians(m, 36);
  for_rows(m, kElementChunk, [&](Index f) {
    Matrix2d stress;
    Matrix4 curvature;
    triangle_model(jacobian(turns_, goal, f), stress, curvature, weights);
    Eigen::Matrix<double, 3, 2> G;
    G.bottomRows<2>() = rest(goal, f);
    G.row(0) = -(G.row(1) + G.row(2));
    Eigen::Matrix<double, 4, 6> D = Eigen::Matrix<double, 4, 6>::Zero();  // of vec(K)
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 2; ++j) D.block<2, 2>(2 * j, 2 * k).diagonal() = periods_ * G(k, j);
    const Eigen::Map<const Eigen::Vector4d> flat(stress.data());
    gradients.row(f) = goal.weights(f) * flat.transpose() * D;
    Eigen::Map<Eigen::Matrix<double, 6, 6>>(hessians.row(f).data()) =
        goal.weights(f) * D.transpose() * curvature * D;
  });
  const Vec gradient = sum_corners(chart_.faces, chart_.n_vertices, gradients);
  const Vec solution = system_.solve(hessians, gradient, poll);
  Points2 direction = Eigen::Map<const Points2>(solution.data(), chart_.n_vertices, 2);
  direction.rowwise() -= direction.colwise().mean();  // translations cost nothing

  const double slope = gradient.dot(solution);
  result.before = result.after = value(turns_, weights, goal);
  result.decrement = -slope;
  Points2 trial;
  double there = result.before;
  result.step =
      linalg::backtrack(result.before, slope, unfolded_step(chart_, turns_, direction, 0.9, 1.0),
                        kChartTries, [&](double t) {
                          trial = turns_ + t * direction;
                          return there = value(trial, weights, goal);
                        });
  if (result.step > 0.0) {
    turns_ = std::move(trial);
    result.after = there;
  }
  return result;
}

SurfaceMeasures ChartNewton::measures() const {
  const Vec image = turn_areas(chart_, turns_);
  SurfaceMeasures measured;
  measured.energy = image.array().square().cwiseQuotient(reference_.areas.array()).sum();
  measured.flips = static_cast<Index>((image.array() <= 0.0).count());
  ratio_measures(chart_.faces, chart_.n_vertices, reference_.areas, image, measured);
  return measured;
}

}  // namespace stretchmap::area
