#include "stretchmap/certificate/embedding.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/predicates.hpp"

namespace stretchmap::certificate {
namespace {

using Triple = Eigen::Matrix<Index, 1, 3>;
using Triangle = std::array<Point, 3>;

constexpr Index kAtOnce = 4096;  // faces between two looks at whether to go on

bool point_in_triangle(const Point& p, const Triangle& t, int axis, int turn) {
  for (int k = 0; k < 3; ++k) {
    if (orient2d(t[k], t[(k + 1) % 3], p, axis) * turn < 0) return false;
  }
  return true;
}

bool segments_meet(const Point& p, const Point& q, const Point& a, const Point& b, int axis) {
  const int pq_a = orient2d(p, q, a, axis), pq_b = orient2d(p, q, b, axis);
  const int ab_p = orient2d(a, b, p, axis), ab_q = orient2d(a, b, q, axis);
  if (pq_a * pq_b > 0 || ab_p * ab_q > 0) return false;
  if (pq_a != 0 || pq_b != 0 || ab_p != 0 || ab_q != 0) return true;
  for (int k = 0; k < 3; ++k) {  // on one line: they meet when their boxes do
    if (k == axis) continue;
    if (std::max(p[k], q[k]) < std::min(a[k], b[k])) return false;
    if (std::max(a[k], b[k]) < std::min(p[k], q[k])) return false;
  }
  return true;
}

bool coplanar_segment_meets(const Point& p, const Point& q, const Triangle& t) {
  for (int axis = 0; axis < 3; ++axis) {
    const int turn = orient2d(t[0], t[1], t[2], axis);
    if (turn == 0) continue;
    if (point_in_triangle(p, t, axis, turn) || point_in_triangle(q, t, axis, turn)) return true;
    for (int k = 0; k < 3; ++k) {
      if (segments_meet(p, q, t[k], t[(k + 1) % 3], axis)) return true;
    }
    return false;
  }
  return true;  // degenerate
}

bool segment_meets_triangle(const Point& p, const Point& q, const Triangle& t) {
  const int side_p = orient3d(t[0], t[1], t[2], p), side_q = orient3d(t[0], t[1], t[2], q);
  if (side_p * side_q > 0) return false;
  if (side_p == 0 && side_q == 0) return coplanar_segment_meets(p, q, t);
  bool left = false, right = false;
  for (int k = 0; k < 3; ++k) {
    const int side = orient3d(p, q, t[k], t[(k + 1) % 3]);
    left = left || side > 0;
    right = right || side < 0;
  }
  return !(left && right);
}

// Whether a plane proves that the triangles have no point in common but corner 0, if that is
// shared. In a hurry: pieces of one flat face, of which refined meshes have many, and needles whose
// boxes overlap are kept from the exact predicates. Planes are along the triangles or upright on an
// edge of one; that rounding puts them a little off does not matter, that of the heights is
// bounded.
bool apart(const Triangle& p, const Triangle& q, bool shared) {
  constexpr double kRounding = 16.0 * std::numeric_limits<double>::epsilon();
  constexpr double kUnderflow = 1e-290;  // heights below it have lost digits
  const Point origin = p[0];
  const auto splits = [&](const Point& up) {
    double low[2], high[2];
    for (const Triangle* t : {&p, &q}) {
      const int side = t == &q;
      low[side] = std::numeric_limits<double>::infinity();
      high[side] = -low[side];
      for (int k = shared; k < 3; ++k) {
        const Point way = (*t)[k] - origin;
        const double height = up.dot(way);
        const double error = kRounding * up.cwiseAbs().dot(way.cwiseAbs()) + kUnderflow;
        if (!std::isfinite(height + error)) return false;
        low[side] = std::min(low[side], height - error);
        high[side] = std::max(high[side], height + error);
      }
    }
    if (!shared) return high[0] < low[1] || high[1] < low[0];
    return (high[0] < 0.0 && low[1] > 0.0) || (high[1] < 0.0 && low[0] > 0.0);
  };
  for (const Triangle* t : {&p, &q}) {
    const Point normal = ((*t)[1] - (*t)[0]).cross((*t)[2] - (*t)[0]);
    if (!shared && splits(normal)) return true;
    for (int k = 0; k < 3; ++k)
      if (splits(normal.cross((*t)[(k + 1) % 3] - (*t)[k]))) return true;
  }
  return false;
}

// Two triangles on the common edge (a, b): they meet beyond it when folded onto each other.
bool folded(const Point& a, const Point& b, const Point& c, const Point& d) {
  if (orient3d(a, b, c, d) != 0) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const int side = orient2d(a, b, c, axis);
    if (side != 0) return side * orient2d(a, b, d, axis) >= 0;
  }
  return true;
}

// Axis-aligned boxes in a balanced binary tree; node k has the children 2 k + 1 and 2 k + 2.
class BoxTree {
 public:
  using Box = Eigen::AlignedBox3d;

  explicit BoxTree(std::vector<Box> boxes) : boxes_(std::move(boxes)), order_(boxes_.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    const auto n = static_cast<Index>(order_.size());
    int depth = 0;
    while (chunk_count(n, Index{1} << depth) > kLeaf) ++depth;
    nodes_.resize((std::size_t{2} << depth) - 1);
    std::vector<Piece> pieces{{0, 0, n}};
    for (int level = 0; level < std::min(depth, kShared); ++level) {
      std::vector<Piece> halves(2 * pieces.size());
      for_tasks(static_cast<Index>(pieces.size()), [&](Index k) {
        const auto [low, high] = halves_of(pieces[k]);
        halves[2 * k] = low;
        halves[2 * k + 1] = high;
      });
      pieces = std::move(halves);
    }
    for_tasks(static_cast<Index>(pieces.size()), [&](Index k) { build(pieces[k]); });
  }

  // Appends every element above `id` whose box meets that of `id`.
  void overlaps(Index id, std::vector<Index>& found) const {
    visit(0, 0, static_cast<Index>(order_.size()), id, found);
  }

 private:
  static constexpr Index kLeaf = 4;
  static constexpr int kShared = 4;  // levels whose nodes are worth a thread each

  struct Piece {
    std::size_t node = 0;
    Index begin = 0, end = 0;
  };

  // Empty ones of a leaf.
  std::pair<Piece, Piece> halves_of(const Piece& piece) {
    const auto [node, begin, end] = piece;
    if (begin == end) return {};
    Box all;
    for (Index i = begin; i < end; ++i) all.extend(boxes_[order_[i]]);
    nodes_[node] = all;
    if (end - begin <= kLeaf) return {};
    int axis = 0;
    all.sizes().maxCoeff(&axis);
    const Index middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](Index a, Index b) {
                       const double x = boxes_[a].center()[axis], y = boxes_[b].center()[axis];
                       return x != y ? x < y : a < b;
                     });
    return {{2 * node + 1, begin, middle}, {2 * node + 2, middle, end}};
  }

  void build(const Piece& piece) {
    const auto [low, high] = halves_of(piece);
    if (low.begin == low.end) return;
    build(low);
    build(high);
  }

  void visit(std::size_t node, Index begin, Index end, Index id, std::vector<Index>& found) const {
    if (!nodes_[node].intersects(boxes_[id])) return;
    if (end - begin <= kLeaf) {
      for (Index i = begin; i < end; ++i) {
        if (order_[i] > id && boxes_[order_[i]].intersects(boxes_[id])) found.push_back(order_[i]);
      }
      return;
    }
    const Index middle = begin + (end - begin) / 2;
    visit(2 * node + 1, begin, middle, id, found);
    visit(2 * node + 2, middle, end, id, found);
  }

  std::vector<Box> boxes_;
  std::vector<Index> order_;
  std::vector<Box> nodes_;
};

}  // namespace

IndexVec not_positive_tets(const PointsRef& points, const TetsRef& tets) {
  std::vector<char> bad(tets.rows());
  for_rows(static_cast<Index>(tets.rows()), kElementChunk, [&](Index t) {
    const auto corner = [&](int k) -> Point { return points.row(tets(t, k)); };
    bad[t] = orient3d(corner(0), corner(1), corner(2), corner(3)) <= 0;
  });
  IndexVec ids(std::count(bad.begin(), bad.end(), 1));
  Index count = 0;
  for (std::size_t t = 0; t < bad.size(); ++t) {
    if (bad[t]) ids[count++] = static_cast<Index>(t);
  }
  return ids;
}

bool triangles_meet(const PointsRef& points, const Triple& a, const Triple& b) {
  // Bring shared vertices to the front of both.
  Triple s = a, t = b;
  int shared = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = shared; j < 3; ++j) {
      if (s[i] == t[j]) {
        std::swap(t[j], t[shared]);
        std::swap(s[i], s[shared]);
        ++shared;
        break;
      }
    }
  }
  const auto corners = [&](const Triple& f) -> Triangle {
    return {points.row(f[0]), points.row(f[1]), points.row(f[2])};
  };
  const Triangle p = corners(s), q = corners(t);
  if (shared == 3) return true;
  if (shared == 2) return folded(p[0], p[1], p[2], q[2]);
  if (apart(p, q, shared == 1)) return false;
  if (shared == 1) {
    return segment_meets_triangle(p[1], p[2], q) || segment_meets_triangle(q[1], q[2], p);
  }
  for (int k = 0; k < 3; ++k) {
    if (segment_meets_triangle(p[k], p[(k + 1) % 3], q)) return true;
    if (segment_meets_triangle(q[k], q[(k + 1) % 3], p)) return true;
  }
  return false;
}

Edges crossing_faces(const PointsRef& points, const FacesRef& faces, Index limit,
                     const Poll& poll) {
  const Index m = static_cast<Index>(faces.rows());
  std::vector<BoxTree::Box> boxes(m);
  for (Index f = 0; f < m; ++f) {
    for (int k = 0; k < 3; ++k) boxes[f].extend(points.row(faces(f, k)).transpose());
  }
  const BoxTree tree(std::move(boxes));
  std::vector<std::array<Index, 2>> pairs;
  for (Index first = 0; first < m && static_cast<Index>(pairs.size()) < limit; first += kAtOnce) {
    if (poll) poll();
    const Index count = std::min(kAtOnce, m - first);
    std::vector<std::vector<std::array<Index, 2>>> found(chunk_count(count, kCostlyChunk));
    for_chunks(count, kCostlyChunk, [&](Index begin, Index end) {
      std::vector<Index> near;
      auto& pairs_here = found[begin / kCostlyChunk];
      // No chunk needs more than are wanted in all: a heap of faces in one place has their square.
      const auto open = [&] { return static_cast<Index>(pairs_here.size()) < limit; };
      for (Index f = first + begin; f < first + end && open(); ++f) {
        near.clear();
        tree.overlaps(f, near);
        std::sort(near.begin(), near.end());
        for (auto g = near.begin(); g != near.end() && open(); ++g)
          if (triangles_meet(points, faces.row(f), faces.row(*g))) pairs_here.push_back({f, *g});
      }
    });
    for (const auto& part : found) pairs.insert(pairs.end(), part.begin(), part.end());
  }
  const Index count = std::min(limit, static_cast<Index>(pairs.size()));
  Edges out(count, 2);
  for (Index k = 0; k < count; ++k) out.row(k) << pairs[k][0], pairs[k][1];
  return out;
}

}  // namespace stretchmap::certificate
