// Points of a surface addressed by a flat chart, and steps along it.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/registration/chart_locator.hpp"

namespace stretchmap::registration {

struct SurfaceWalk {
  const ChartLocator& locator;  // of the surface's flat chart
  PointsRef points;             // (n, 3) vertices
  FacesRef faces;               // (m, 3)
  RowsRef slopes;               // (m, 6) of each face: derivative of the point by the chart,
                                // row-major 3x2

  // \param x the point at chart position y.
  // \return false if no face holds y.
  bool point(const Eigen::RowVector2d& y, Eigen::RowVector3d& x) const;

  // \return chart steps that move a point by one unit along two orthogonal directions of its face,
  // as
  //         columns; zero if no face holds y.
  Eigen::Matrix2d steps(const Eigen::RowVector2d& y) const;
};

struct RelaxReport {
  double gain = 0.0;  // by how much the energy fell
  Index moved = 0;    // vertices moved, each counted once a sweep
};

// Lengths tried in a search by values: doubled after a success, halved after a failure, but not
// below a thousandth of what they were.
class Reach {
 public:
  explicit Reach(Vec& lengths) : lengths_(lengths), least_(1e-3 * lengths) {}
  double operator[](Index i) const { return lengths_[i]; }
  void update(Index i, bool success) {
    lengths_[i] = success ? 2.0 * lengths_[i] : std::max(0.5 * lengths_[i], least_[i]);
  }

 private:
  Vec& lengths_;
  Vec least_;
};

}  // namespace stretchmap::registration
