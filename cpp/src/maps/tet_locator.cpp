#include "stretchmap/maps/tet_locator.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::maps {
namespace {

constexpr Index kBatch = 65536;      // queries between two polls
constexpr std::size_t kBoxes = 256;  // likewise, small ones
constexpr Index kLeafTets = 6;       // tets that are not halved any further
constexpr int kDeepestBox = 64;      // boxes that wait; halves of fewer than 2^32 tets
// Turning a point, at most about one from the origin, rounds it by less.
constexpr double kRounding = 16.0 * std::numeric_limits<double>::epsilon();
// Tets as long as wide to this share keep the axes of the box they are in.
constexpr double kRound = 0.1;

using Corners = Eigen::Matrix<double, 3, 4>;

}  // namespace

struct TetLocator::Best {
  Index tet = -1, visits = 0;
  double distance = -std::numeric_limits<double>::infinity();  // to the worst face, inside positive
  Index nearest = -1;                                          // whose distance that is
  Eigen::Vector4d weights = Eigen::Vector4d::Constant(std::numeric_limits<double>::quiet_NaN());
};

// What is known of the tets while boxes are halved.
struct TetLocator::Halving {
  std::vector<Corners> corners;  // of each tet
  std::vector<double> key;       // of each tet: where it lies along the axis of the cut
  int axis = 0;
};

TetLocator::TetLocator(const PointsRef& points, const TetsRef& tets, double tolerance,
                       const Poll& poll)
    : points_(points), tets_(tets), tolerance_(tolerance), order_(tets.rows()) {
  const Index k = static_cast<Index>(tets_.rows());
  if (k == 0) return;
  const Eigen::Vector3d low = points_.colwise().minCoeff(), high = points_.colwise().maxCoeff();
  center_ = 0.5 * low + 0.5 * high;
  const double size = (0.5 * high - 0.5 * low).maxCoeff();
  if (size > std::numeric_limits<double>::min()) scale_ = 1.0 / size;
  Halving halving{std::vector<Corners>(k), std::vector<double>(k), 0};
  for_rows(k, kElementChunk, [&](Index t) {
    for (int a = 0; a < 4; ++a)
      halving.corners[t].col(a) = unit(points_.row(tets_(t, a)).transpose());
  });
  std::iota(order_.begin(), order_.end(), 0);
  boxes_.reserve(static_cast<std::size_t>(k) / 2);
  grow(0, k, Eigen::Matrix3d::Identity(), halving, poll);
}

void TetLocator::grow(Index begin, Index end, const Eigen::Matrix3d& axes, Halving& halving,
                      const Poll& poll) {
  const std::size_t id = boxes_.size();
  if (poll && (id % kBoxes == 0 || end - begin > kBatch)) poll();
  Box box;
  box.axes = axes;
  box.begin = begin;
  box.end = end;
  measure(box, halving);
  boxes_.push_back(box);
  if (end - begin <= kLeafTets) return;
  const Index middle = begin + (end - begin) / 2;
  const auto tet = [&](Index place) { return order_.begin() + place; };
  std::nth_element(tet(begin), tet(middle), tet(end), [&](Index s, Index t) {
    return std::pair(halving.key[s], s) < std::pair(halving.key[t], t);
  });
  grow(begin, middle, box.axes, halving, poll);
  boxes_[id].second = static_cast<Index>(boxes_.size());
  grow(middle, end, box.axes, halving, poll);
}

// Axes and size of a box, and where it is cut: along the axis with most tets one after the other.
void TetLocator::measure(Box& box, Halving& halving) const {
  Eigen::Matrix3d shape = Eigen::Matrix3d::Zero();
  for (Index i = box.begin; i < box.end; ++i) {
    const Corners& x = halving.corners[order_[i]];
    const Corners apart = x.colwise() - x.rowwise().mean();
    if (const double square = apart.squaredNorm(); square > 0.0)
      shape += apart * apart.transpose() / square;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(shape);
  if (solver.eigenvalues()[0] < kRound * solver.eigenvalues()[2])
    box.axes = solver.eigenvectors().transpose();

  constexpr double infinity = std::numeric_limits<double>::infinity();
  box.low.setConstant(infinity);
  box.high.setConstant(-infinity);
  box.first_tet = order_[box.begin];
  Eigen::Vector3d first = box.low, last = box.high, extent = Eigen::Vector3d::Zero();
  for (Index i = box.begin; i < box.end; ++i) {
    const Corners x = box.axes * halving.corners[order_[i]];
    const Eigen::Vector3d low = x.rowwise().minCoeff(), high = x.rowwise().maxCoeff();
    box.low = box.low.cwiseMin(low);
    box.high = box.high.cwiseMax(high);
    first = first.cwiseMin(low + high);
    last = last.cwiseMax(low + high);
    extent += high - low;
    box.first_tet = std::min(box.first_tet, order_[i]);
  }
  const double slack = tolerance_ * scale_ + kRounding;
  box.low.array() -= slack;
  box.high.array() += slack;
  ((last - first).array() / extent.array().max(std::numeric_limits<double>::min()))
      .maxCoeff(&halving.axis);
  for (Index i = box.begin; i < box.end; ++i) {
    const Eigen::RowVector4d x = box.axes.row(halving.axis) * halving.corners[order_[i]];
    halving.key[order_[i]] = x.minCoeff() + x.maxCoeff();
  }
}

void TetLocator::examine(const Eigen::Vector3d& p, Index t, Best& best) const {
  Eigen::Matrix<double, 3, 4> x;
  for (int a = 0; a < 4; ++a) x.col(a) = points_.row(tets_(t, a)).transpose() - p;
  const Eigen::Vector3d ab = x.col(0).cross(x.col(1)), cd = x.col(2).cross(x.col(3));
  const Eigen::Vector4d w(x.col(1).dot(cd), -x.col(0).dot(cd), x.col(3).dot(ab), -x.col(2).dot(ab));
  const double volume = w.sum();
  if (!(volume > 0.0)) return;
  if (w.minCoeff() >= 0.0) {
    best.tet = best.nearest = t;
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
  if (distance > best.distance || (distance == best.distance && t < best.nearest)) {
    best.distance = distance;
    best.nearest = t;
    best.weights = w / volume;
    if (distance >= -tolerance_) best.tet = t;
  }
}

TetLocator::Best TetLocator::find(const Eigen::Vector3d& p) const {
  Best best;
  const Eigen::Vector3d at = unit(p);
  Index open[kDeepestBox];
  int n_open = 0;
  if (!boxes_.empty()) open[n_open++] = 0;
  while (n_open > 0) {
    const Index id = open[--n_open];
    const Box& box = boxes_[id];
    const auto is_beaten = [&](Index t) { return best.distance >= 0.0 && t > best.tet; };
    if (is_beaten(box.first_tet)) continue;
    ++best.visits;
    const Eigen::Vector3d x = box.axes * at;
    // The comparison fails for a NaN, too.
    if (!((x.array() >= box.low.array()).all() && (x.array() <= box.high.array()).all())) continue;
    if (box.second >= 0) {
      open[n_open++] = box.second;
      open[n_open++] = id + 1;
      continue;
    }
    for (Index i = box.begin; i < box.end; ++i) {
      if (is_beaten(order_[i])) continue;
      ++best.visits;
      examine(p, order_[i], best);
    }
  }
  return best;
}

IndexVec TetLocator::visits(const PointsRef& queries) const {
  IndexVec count(queries.rows());
  for_rows(static_cast<Index>(queries.rows()), kCostlyChunk,
           [&](Index i) { count[i] = find(queries.row(i).transpose()).visits; });
  return count;
}

TetLocation TetLocator::locate(const PointsRef& queries, const Poll& poll) const {
  const Index n = static_cast<Index>(queries.rows());
  TetLocation found{IndexVec(n), Rows(n, 4)};
  for (Index begin = 0; begin < n; begin += kBatch) {
    if (poll) poll();
    for_rows(std::min(kBatch, n - begin), kCostlyChunk, [&](Index row) {
      const Index i = begin + row;
      const Best best = find(queries.row(i).transpose());
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
