#include "stretchmap/maps/tet_locator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::maps {
namespace {

constexpr Index kBatch = 65536;  // queries between two polls
constexpr double kMaxCells = 8e6;

}  // namespace

struct TetLocator::Best {
  Index tet = -1;
  double distance = -std::numeric_limits<double>::infinity();  // to the worst face, inside positive
  Eigen::Vector4d weights = Eigen::Vector4d::Constant(std::numeric_limits<double>::quiet_NaN());
};

TetLocator::TetLocator(const PointsRef& points, const TetsRef& tets, double tolerance)
    : points_(points), tets_(tets), tolerance_(tolerance) {
  const Index k = static_cast<Index>(tets_.rows());
  Points lower(k, 3), upper(k, 3);
  for (Index t = 0; t < k; ++t) {
    lower.row(t) = upper.row(t) = points_.row(tets_(t, 0));
    for (int a = 1; a < 4; ++a) {
      lower.row(t) = lower.row(t).cwiseMin(points_.row(tets_(t, a)));
      upper.row(t) = upper.row(t).cwiseMax(points_.row(tets_(t, a)));
    }
  }
  lower.array() -= tolerance_;
  upper.array() += tolerance_;
  low_ = lower.colwise().minCoeff().transpose();
  high_ = upper.colwise().maxCoeff().transpose();

  // Cells about as large as the mean box of a tet.
  const Eigen::Vector3d extent = high_ - low_;
  const Eigen::Vector3d mean = (upper - lower).colwise().mean().transpose();
  Eigen::Array3d wish = (extent.array() / mean.array().max(1e-300)).max(1.0);
  wish *= std::min(1.0, std::cbrt(kMaxCells / wish.prod()));
  size_ = wish.max(1.0).cast<int>();
  inverse_cell_ = size_.cast<double>() / extent.array().max(1e-300);

  const auto range = [&](Index t, Eigen::Array3i& a, Eigen::Array3i& b) {
    const auto index = [&](const auto& row) -> Eigen::Array3i {
      const Eigen::Array3d place = (row.transpose() - low_).array() * inverse_cell_.array();
      return place.cast<int>().max(0).min(size_ - 1);
    };
    a = index(lower.row(t));
    b = index(upper.row(t));
  };
  const auto for_cells = [&](const auto& visit) {
    Eigen::Array3i a, b;
    for (Index t = 0; t < k; ++t) {
      range(t, a, b);
      for (int z = a[2]; z <= b[2]; ++z)
        for (int y = a[1]; y <= b[1]; ++y)
          for (int x = a[0]; x <= b[0]; ++x) visit(x + size_[0] * (y + size_[1] * z), t);
    }
  };
  tets_in_ = Incidence<Index, std::int64_t>(size_.prod(), for_cells);
}

Index TetLocator::cell(const Eigen::Vector3d& p) const {
  const Eigen::Array3i i =
      ((p - low_).array() * inverse_cell_.array()).cast<int>().max(0).min(size_ - 1);
  return i[0] + size_[0] * (i[1] + size_[1] * i[2]);
}

void TetLocator::examine(const Eigen::Vector3d& p, Index t, Best& best) const {
  Eigen::Matrix<double, 3, 4> x;
  for (int a = 0; a < 4; ++a) x.col(a) = points_.row(tets_(t, a)).transpose() - p;
  const Eigen::Vector3d ab = x.col(0).cross(x.col(1)), cd = x.col(2).cross(x.col(3));
  const Eigen::Vector4d w(x.col(1).dot(cd), -x.col(0).dot(cd), x.col(3).dot(ab), -x.col(2).dot(ab));
  const double volume = w.sum();
  if (!(volume > 0.0)) return;
  if (w.minCoeff() >= 0.0) {
    best.tet = t;
    best.distance = 0.0;
    best.weights = w / volume;
    return;
  }
  double distance = 0.0;
  for (int a = 0; a < 4; ++a) {
    if (w[a] >= 0.0) continue;
    const Eigen::Vector3d o = x.col((a + 1) % 4);
    const double area = (x.col((a + 2) % 4) - o).cross(x.col((a + 3) % 4) - o).norm();
    distance = std::min(distance, w[a] / area);
  }
  if (distance > best.distance) {
    best.distance = distance;
    best.weights = w / volume;
    if (distance >= -tolerance_) best.tet = t;
  }
}

TetLocation TetLocator::locate(const PointsRef& queries, const Poll& poll) const {
  const Index n = static_cast<Index>(queries.rows());
  TetLocation found{IndexVec(n), Rows(n, 4)};
  for (Index begin = 0; begin < n; begin += kBatch) {
    if (poll) poll();
    for_rows(std::min(kBatch, n - begin), kCostlyChunk, [&](Index row) {
      const Index i = begin + row;
      const Eigen::Vector3d p = queries.row(i).transpose();
      Best best;
      // The comparison fails for a NaN, too.
      if ((p.array() >= low_.array()).all() && (p.array() <= high_.array()).all()) {
        for (const Index t : tets_in_[cell(p)]) {
          examine(p, t, best);
          if (best.distance >= 0.0) break;
        }
      }
      found.tet[i] = best.tet;
      if (best.tet >= 0)
        found.weights.row(i) = best.weights.transpose();
      else
        found.weights.row(i).setConstant(std::numeric_limits<double>::quiet_NaN());
    });
  }
  return found;
}

}  // namespace stretchmap::maps
