#include "stretchmap/registration/chart_locator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::registration {
namespace {

constexpr double kSlack = 1e-9;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace

ChartLocator::ChartLocator(area::SurfaceChart chart, const Points2Ref& turns)
    : chart_(std::move(chart)), turns_(turns) {
  const Index m = static_cast<Index>(chart_.faces.rows());
  size_ = std::clamp<Index>(static_cast<Index>(std::sqrt(0.5 * m)), 1, 2000);
  const auto for_cells = [&](const auto& visit) {
    for (Index f = 0; f < m; ++f) {
      Eigen::Vector2d low = chart_.corner(turns_, f, 0), high = low;
      for (int k = 1; k < 3; ++k) {
        low = low.cwiseMin(chart_.corner(turns_, f, k));
        high = high.cwiseMax(chart_.corner(turns_, f, k));
      }
      const auto index = [&](double x) { return static_cast<Index>(std::floor(x * size_)); };
      const Index x0 = index(low.x() - kSlack), y0 = index(low.y() - kSlack);
      const Index x1 = std::min(index(high.x() + kSlack), x0 + size_ - 1);
      const Index y1 = std::min(index(high.y() + kSlack), y0 + size_ - 1);
      for (Index y = y0; y <= y1; ++y)
        for (Index x = x0; x <= x1; ++x) {
          const Index cx = ((x % size_) + size_) % size_, cy = ((y % size_) + size_) % size_;
          visit(cx + size_ * cy, f);
        }
    }
  };
  faces_ = Incidence<Index, std::int64_t>(size_ * size_, for_cells);
}

Index ChartLocator::wrap(double coordinate) const {
  const double fraction = coordinate - std::floor(coordinate);
  if (!(fraction >= 0.0)) return 0;  // of no number: found nowhere
  return std::min(static_cast<Index>(fraction * size_), size_ - 1);
}

ChartLocator::Hit ChartLocator::find(const Eigen::Vector2d& q) const {
  Hit best;
  double least = -kSlack;
  for (const Index f : faces_[wrap(q.x()) + size_ * wrap(q.y())]) {
    Eigen::Matrix<double, 2, 3> x;
    for (int k = 0; k < 3; ++k) x.col(k) = chart_.corner(turns_, f, k);
    const Eigen::Vector2d center = x.rowwise().mean();
    const Eigen::Vector2d p = q + (center - q).array().round().matrix();
    x.colwise() -= p;
    const Eigen::Vector3d w(cross(x.col(1), x.col(2)), cross(x.col(2), x.col(0)),
                            cross(x.col(0), x.col(1)));
    const double area = w.sum();
    if (!(area > 0.0) || !(w.minCoeff() / area > least)) continue;
    best.face = f;
    best.weights = w / area;
    least = best.weights.minCoeff();
  }
  return best;
}

FaceLocation ChartLocator::locate(const Points2Ref& queries) const {
  const Index n = static_cast<Index>(queries.rows());
  FaceLocation found{IndexVec(n), Points(n, 3)};
  for_rows(n, kCostlyChunk, [&](Index i) {
    const Hit hit = find(queries.row(i).transpose());
    found.face[i] = hit.face;
    found.weights.row(i) = hit.weights.transpose();
  });
  return found;
}

}  // namespace stretchmap::registration
