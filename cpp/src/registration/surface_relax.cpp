#include "stretchmap/registration/surface_relax.hpp"

#include <cmath>
#include <limits>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/torus.hpp"
#include "stretchmap/registration/surface_match.hpp"

namespace stretchmap::registration {
namespace {

constexpr int kDirections = 8;

class Search {
 public:
  Search(const area::SurfaceChart& chart, const SurfaceWalk& target, const RowsRef& rest,
         const VecRef& weights, Points2& y, Points& X)
      : chart_(chart),
        target_(target),
        rest_(rest),
        weights_(weights),
        y_(y),
        X_(X),
        corners_(corners_at(chart.faces, chart.n_vertices)) {}

  // Tries one vertex; returns by how much the energy fell, 0 if it stays.
  double improve(Index i, double reach) {
    const double before = ring_value(i);
    const Eigen::RowVector2d y = y_.row(i);
    const Eigen::RowVector3d X = X_.row(i);
    double best = before;
    Eigen::RowVector2d best_y = y;
    Eigen::RowVector3d best_X = X;
    const Eigen::Matrix2d steps = target_.steps(y);
    for (int d = 0; d < kDirections; ++d) {
      const double angle = kTwoPi * d / kDirections;
      const Eigen::Vector2d way(std::cos(angle), std::sin(angle));
      y_.row(i) = y + (reach * steps * way).transpose();
      Eigen::RowVector3d there;
      if (!target_.point(y_.row(i), there)) continue;
      X_.row(i) = there;
      const double value = ring_value(i);
      if (value < best) best = value, best_y = y_.row(i), best_X = X_.row(i);
    }
    y_.row(i) = best_y;
    X_.row(i) = best_X;
    return before - best;
  }

 private:
  double ring_value(Index i) const {
    double total = 0.0;
    for (const Index corner : corners_[i]) {
      const Index f = corner / 3;
      total += weights_[f] * face_value(chart_, y_, X_, rest_, f);
      if (!std::isfinite(total)) return std::numeric_limits<double>::infinity();
    }
    return total;
  }

  const area::SurfaceChart& chart_;
  const SurfaceWalk& target_;
  const RowsRef& rest_;
  const VecRef& weights_;
  Points2& y_;
  Points& X_;
  Incidence<> corners_;
};

}  // namespace

RelaxReport relax_match(const area::SurfaceChart& chart, const SurfaceWalk& target,
                        const RowsRef& rest, const VecRef& weights, const FlagsRef& held,
                        int sweeps, Points2& y, Points& X, Vec& reach, const Poll& poll) {
  Search search(chart, target, rest, weights, y, X);
  Reach lengths(reach);
  RelaxReport report;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (Index i = 0; i < chart.n_vertices; ++i) {
      if (poll && i % 64 == 0) poll();
      if (held[i]) continue;
      const double gain = search.improve(i, lengths[i]);
      lengths.update(i, gain > 0.0);
      report.gain += gain;
      report.moved += gain > 0.0;
    }
  }
  return report;
}

}  // namespace stretchmap::registration
