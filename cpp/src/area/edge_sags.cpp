#include "stretchmap/area/edge_sags.hpp"

#include <algorithm>
#include <limits>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"

namespace stretchmap::area {

Vec edge_sags(const mesh::SurfaceTopology& top, const SurfaceChart& chart, const VecRef& areas,
              const Points2Ref& angles, double ratio) {
  const Torus torus = Torus::of_area_one(ratio);
  const Points2 turns = angles / kTwoPi;
  const double total = areas.sum();
  Points sags(chart.faces.rows(), 3);
  for_rows(static_cast<Index>(sags.rows()), kElementChunk, [&](Index f) {
    Eigen::Vector2d angle[3];
    Eigen::Vector3d point[3];
    for (int k = 0; k < 3; ++k) {
      angle[k] = kTwoPi * chart.corner(turns, f, k);
      point[k] = torus.point(angle[k].x(), angle[k].y());
    }
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      const Eigen::Vector2d middle = 0.5 * (angle[k] + angle[next]);
      const Eigen::Vector3d over = torus.point(middle.x(), middle.y());
      const double sag = (over - 0.5 * (point[k] + point[next])).norm();
      // Along the torus: the ends of a long edge may be close to each other.
      const Eigen::Vector2d scale(torus.R + torus.r * std::cos(middle.y()), torus.r);
      const Eigen::Vector2d along = scale.cwiseProduct(angle[next] - angle[k]);
      const Eigen::Vector2d third = scale.cwiseProduct(angle[(k + 2) % 3] - angle[k]);
      const double square = std::max(along.squaredNorm(), std::numeric_limits<double>::min());
      const double foot = std::clamp(third.dot(along) / square, 0.0, 1.0);
      const double there = 4.0 * foot * (1.0 - foot);  // of the sag in the middle
      sags(f, k) = there * sag * along.norm() * total / (2.0 * areas(f));
    }
  });
  Vec most = Vec::Zero(top.edges.rows());
  for (Index h = 0; h < top.edge.size(); ++h)
    most(top.edge(h)) = std::max(most(top.edge(h)), sags(h / 3, h % 3));
  return most;
}

}  // namespace stretchmap::area
