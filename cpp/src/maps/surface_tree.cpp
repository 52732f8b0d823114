#include "stretchmap/maps/surface_tree.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::maps {
namespace {

using Eigen::Array3d;
using Eigen::Vector3d;

constexpr Index kLeaf = 4;
constexpr int kDeepest = 64;  // halves of 2^31 faces

double squared_distance_to_box(const Vector3d& p, const Array3d& low, const Array3d& high) {
  return (low - p.array()).max(p.array() - high).max(0.0).square().sum();
}

bool neither_positive(double s, double t) { return s <= 0.0 && t <= 0.0; }

// Barycentric coordinates of the point of triangle a b c closest to p, by the region of the plane
// in which p lies.
Vector3d closest_weights(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                         const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (neither_positive(d1, d2)) return {1.0, 0.0, 0.0};
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (neither_positive(-d3, d4 - d3)) return {0.0, 1.0, 0.0};
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (neither_positive(-d6, d5 - d6)) return {0.0, 0.0, 1.0};
  const double at_c = d1 * d4 - d3 * d2, at_b = d5 * d2 - d1 * d6, at_a = d3 * d6 - d5 * d4;
  if (at_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3) {
    const double t = d1 / (d1 - d3);
    return {1.0 - t, t, 0.0};
  }
  if (at_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    const double t = d2 / (d2 - d6);
    return {1.0 - t, 0.0, t};
  }
  if (at_a <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0.0, 1.0 - t, t};
  }
  return Vector3d(at_a, at_b, at_c) / (at_a + at_b + at_c);
}

}  // namespace

SurfaceTree::SurfaceTree(const PointsRef& points, const FacesRef& faces)
    : points_(points), faces_(faces), order_(faces.rows()) {
  const Index m = static_cast<Index>(faces.rows());
  std::iota(order_.begin(), order_.end(), 0);
  std::vector<Array3d> centers(m);
  for (Index f = 0; f < m; ++f)
    centers[f] =
        (points.row(faces(f, 0)) + points.row(faces(f, 1)) + points.row(faces(f, 2))).array() / 3.0;
  nodes_.reserve(m);
  build(0, m, centers);
}

Index SurfaceTree::build(Index first, Index last, std::vector<Array3d>& centers) {
  const Index at = static_cast<Index>(nodes_.size());
  Node node;
  node.low.setConstant(std::numeric_limits<double>::infinity());
  node.high = -node.low;
  Array3d least = node.low, most = node.high;
  for (Index p = first; p < last; ++p) {
    for (int k = 0; k < 3; ++k) {
      const Array3d corner = points_.row(faces_(order_[p], k)).transpose().array();
      node.low = node.low.min(corner);
      node.high = node.high.max(corner);
    }
    least = least.min(centers[order_[p]]);
    most = most.max(centers[order_[p]]);
  }
  node.first = first;
  node.last = last;
  node.leaf = last - first <= kLeaf;
  nodes_.push_back(node);
  if (node.leaf) return at;
  int axis;
  (most - least).maxCoeff(&axis);
  const Index middle = first + (last - first) / 2;
  std::nth_element(
      order_.begin() + first, order_.begin() + middle, order_.begin() + last,
      [&](Index a, Index b) {
        return centers[a][axis] != centers[b][axis] ? centers[a][axis] < centers[b][axis] : a < b;
      });
  build(first, middle, centers);
  nodes_[at].last = build(middle, last, centers);
  return at;
}

Foot SurfaceTree::on_face(const Vector3d& query, Index face) const {
  const Vector3d a = points_.row(faces_(face, 0)), b = points_.row(faces_(face, 1)),
                 c = points_.row(faces_(face, 2));
  Foot foot;
  foot.face = face;
  foot.weights = closest_weights(query, a, b, c);
  foot.point = foot.weights[0] * a + foot.weights[1] * b + foot.weights[2] * c;
  foot.squared_distance = (query - foot.point).squaredNorm();
  return foot;
}

Foot SurfaceTree::closest(const Vector3d& query, Index hint) const {
  Foot best = on_face(query, hint);
  // A face without area may have no answer.
  if (!(best.squared_distance >= 0.0))
    best.squared_distance = std::numeric_limits<double>::infinity();
  struct Open {
    Index node;
    double distance;
  };
  std::array<Open, 2 * kDeepest> stack;
  int top = 0;
  const auto push = [&](Index node) {
    const double d = squared_distance_to_box(query, nodes_[node].low, nodes_[node].high);
    if (d < best.squared_distance) stack[top++] = {node, d};
  };
  push(0);
  while (top > 0) {
    const Open open = stack[--top];
    if (!(open.distance < best.squared_distance)) continue;
    const Node& node = nodes_[open.node];
    if (node.leaf) {
      for (Index p = node.first; p < node.last; ++p) {
        const Foot foot = on_face(query, order_[p]);
        if (foot.squared_distance < best.squared_distance) best = foot;
      }
      continue;
    }
    push(open.node + 1);
    push(node.last);
    // The nearer child is looked at first.
    if (top >= 2 && stack[top - 1].distance > stack[top - 2].distance &&
        stack[top - 2].node == open.node + 1 && stack[top - 1].node == node.last)
      std::swap(stack[top - 1], stack[top - 2]);
  }
  return best;
}

SurfaceFeet SurfaceTree::feet(const PointsRef& queries, const Poll& poll) const {
  const Index n = static_cast<Index>(queries.rows());
  SurfaceFeet out;
  out.points.resize(n, 3);
  out.face.resize(n);
  out.weights.resize(n, 3);
  constexpr Index kBetweenPolls = 1 << 16;
  for (Index first = 0; first < n; first += kBetweenPolls) {
    if (poll) poll();
    for_rows(std::min(kBetweenPolls, n - first), kCostlyChunk, [&](Index row) {
      const Index i = first + row;
      const Foot foot = closest(queries.row(i).transpose());
      out.points.row(i) = foot.point.transpose();
      out.face[i] = foot.face;
      out.weights.row(i) = foot.weights.transpose();
    });
  }
  return out;
}

}  // namespace stretchmap::maps
