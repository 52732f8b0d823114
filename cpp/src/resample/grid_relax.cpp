#include "stretchmap/resample/grid_relax.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace stretchmap::resample {
namespace {

constexpr int kAround = 8;
constexpr double kSharesHome[] = {1.0, 0.25};

// Axes and diagonals of a cube, unit length.
std::vector<Eigen::RowVector3d> space_directions() {
  std::vector<Eigen::RowVector3d> out;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) {
        const int ends = std::abs(i) + std::abs(j) + std::abs(k);
        if (ends == 1 || ends == 3) out.push_back(Eigen::RowVector3d(i, j, k).normalized());
      }
  return out;
}

class Search {
 public:
  Search(const GridCorners& corners, const GridEnergy& energy, Points& x)
      : corners_(corners), energy_(energy), x_(x), start_(x.rows() + 1, 0) {
    const Index c = static_cast<Index>(corners.tets.rows());
    for (Index t = 0; t < c; ++t)
      for (int a = 0; a < 4; ++a) ++start_[corners.tets(t, a) + 1];
    for (Index i = 0; i < x.rows(); ++i) start_[i + 1] += start_[i];
    std::vector<Index> cursor(start_.begin(), start_.end() - 1);
    corner_.resize(start_.back());
    for (Index t = 0; t < c; ++t)
      for (int a = 0; a < 4; ++a) corner_[cursor[corners.tets(t, a)]++] = t;
  }

  // The terms of Psi that vertex i has a part in.
  double around(Index i) {
    double total = energy_.pull[i] * (x_.row(i) - energy_.home.row(i)).squaredNorm();
    for (Index p = start_[i]; p < start_[i + 1]; p += volume::kLanes) {
      const int used = std::min<Index>(volume::kLanes, start_[i + 1] - p);
      for (int lane = 0; lane < volume::kLanes; ++lane)
        load(corner_[p + std::min(lane, used - 1)], lane);
      volume::element_values(batch_, energy_.corner);
      for (int lane = 0; lane < used; ++lane) {
        const double excess = batch_.energy[lane] - energy_.slack;
        if (excess > 0.0)
          total += corners_.weights[corner_[p + lane]] * std::pow(excess, energy_.power);
      }
    }
    return total;
  }

  double improve_inside(Index i, double reach) {
    const double before = around(i);
    if (before == 0.0) return 0.0;
    const Eigen::RowVector3d old = x_.row(i), way_home = energy_.home.row(i) - old;
    Eigen::RowVector3d best_x = old;
    double best = before;
    const auto attempt = [&](const Eigen::RowVector3d& there) {
      x_.row(i) = there;
      const double value = around(i);
      if (value < best) best = value, best_x = there;
    };
    for (const double share : kSharesHome) attempt(old + share * way_home);
    for (const Eigen::RowVector3d& way : directions_) attempt(old + reach * way);
    x_.row(i) = best_x;
    return before - best;
  }

  double improve_on(const registration::SurfaceWalk& surface, Index i,
                    const Eigen::RowVector2d& home, double reach, Eigen::RowVector2d& y) {
    const double before = around(i);
    if (before == 0.0) return 0.0;
    const Eigen::RowVector2d old = y;
    Eigen::RowVector3d best_x = x_.row(i), there;
    double best = before;
    const auto attempt = [&](const Eigen::RowVector2d& moved) {
      if (!surface.point(moved, there)) return;
      x_.row(i) = there;
      const double value = around(i);
      if (value < best) best = value, best_x = there, y = moved;
    };
    for (const double share : kSharesHome) attempt(old + share * (home - old));
    const Eigen::Matrix2d steps = surface.steps(old);
    for (int d = 0; d < kAround; ++d) {
      const double angle = 2.0 * M_PI * d / kAround;
      const Eigen::Vector2d way(std::cos(angle), std::sin(angle));
      attempt(old + (reach * steps * way).transpose());
    }
    x_.row(i) = best_x;
    return before - best;
  }

 private:
  void load(Index t, int lane) {
    for (int a = 1; a < 4; ++a)
      for (int k = 0; k < 3; ++k)
        batch_.edges[3 * (a - 1) + k][lane] =
            x_(corners_.tets(t, a), k) - x_(corners_.tets(t, 0), k);
    for (int k = 0; k < 9; ++k) batch_.rest[k][lane] = corners_.rest(t, k);
    batch_.weight[lane] = 1.0;
  }

  const GridCorners& corners_;
  const GridEnergy& energy_;
  Points& x_;
  volume::ElementBatch batch_;
  std::vector<Index> start_, corner_;
  std::vector<Eigen::RowVector3d> directions_ = space_directions();
};

}  // namespace

registration::RelaxReport relax_grid(const GridCorners& corners, const GridEnergy& energy,
                                     const registration::SurfaceWalk& surface,
                                     const IndexVecRef& rim, int sweeps, Points2& y, Points& x,
                                     Vec& reach, const Poll& poll) {
  Search search(corners, energy, x);
  const Index n = static_cast<Index>(x.rows());
  IndexVec place = IndexVec::Constant(n, -1);
  for (Index b = 0; b < rim.size(); ++b) place[rim[b]] = b;
  registration::Reach lengths(reach);
  registration::RelaxReport report;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (Index i = 0; i < n; ++i) {
      if (poll && i % 32 == 0) poll();
      double gain = 0.0;
      if (place[i] < 0) {
        gain = search.improve_inside(i, lengths[i]);
      } else {
        Eigen::RowVector2d at = y.row(place[i]);
        gain = search.improve_on(surface, i, energy.home_y.row(place[i]), lengths[i], at);
        y.row(place[i]) = at;
      }
      lengths.update(i, gain > 0.0);
      report.gain += gain;
      report.moved += gain > 0.0;
    }
  }
  return report;
}

}  // namespace stretchmap::resample
