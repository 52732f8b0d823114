#include "stretchmap/area/straight_drawing.hpp"

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <vector>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::area {

namespace {

using Triple = std::array<Index, 3>;
using Counts = Eigen::Matrix<std::int64_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

[[noreturn]] void refuse() {
  throw Error("ArrayError", "the faces are not a disk with three vertices at its rim");
}

// Which vertex follows on which round another one.
class Fans {
 public:
  explicit Fans(const FacesRef& faces) {
    sides_.reserve(3 * faces.rows());
    for (Index f = 0; f < faces.rows(); ++f) {
      for (int k = 0; k < 3; ++k) {
        sides_.push_back({faces(f, k), faces(f, (k + 1) % 3), faces(f, (k + 2) % 3)});
      }
    }
    std::sort(sides_.begin(), sides_.end());
  }

  Index after(Index center, Index before) const {
    const auto found = std::lower_bound(sides_.begin(), sides_.end(), Triple{center, before, -1});
    const bool any = found != sides_.end() && (*found)[0] == center && (*found)[1] == before;
    return any ? (*found)[2] : -1;
  }

  // Calls visit(v) for the neighbors of a vertex that is not at the rim.
  template <typename Visit>
  void neighbors(Index center, Visit visit) const {
    auto at = std::lower_bound(sides_.begin(), sides_.end(), Triple{center, -1, -1});
    for (; at != sides_.end() && (*at)[0] == center; ++at) visit((*at)[1]);
  }

 private:
  std::vector<Triple> sides_;
};

// The three trees, found by taking away vertices from the corner at the top. What is left is a disk
// at every moment: no vertex goes that has an edge across it.
class Trees {
 public:
  Trees(const FacesRef& faces, Index n, const Triple& corners)
      : parent(Faces::Constant(n, 3, -1)),
        fans_(faces),
        corners_(corners),
        left_(n, -1),
        right_(n, -1),
        state_(n, kInside),
        across_(n, 0) {
    const auto [first, second, top] = corners;
    join(first, top);
    join(top, second);
    for (const Index corner : corners) state_[corner] = kRim;
    std::vector<Index> ready{top};
    while (!ready.empty()) {
      const Index v = ready.back();
      ready.pop_back();
      if (may_go(v)) take_away(v, ready);
    }
    if (static_cast<Index>(order.size()) != n - 2) refuse();
  }

  Faces parent;              // (n, 3) in each tree, -1 at the corners
  std::vector<Index> order;  // all but the first two corners, as they were taken away

 private:
  enum State : std::uint8_t { kInside, kRim, kGone };

  void join(Index l, Index r) {
    right_[l] = r;
    left_[r] = l;
  }

  bool may_go(Index v) const {
    return state_[v] == kRim && across_[v] == 0 && v != corners_[0] && v != corners_[1];
  }

  void take_away(Index v, std::vector<Index>& ready) {
    const Index l = left_[v], r = right_[v];
    state_[v] = kGone;
    order.push_back(v);
    if (v != corners_[2]) parent.row(v).head<2>() << l, r;
    uncovered_.clear();
    for (Index last = l, at = fans_.after(v, l);; last = at, at = fans_.after(v, at)) {
      if (at < 0) refuse();
      join(last, at);
      if (at == r) break;
      if (state_[at] != kInside) refuse();
      state_[at] = kRim;
      parent(at, 2) = v;
      uncovered_.push_back(at);
    }
    for (const Index u : uncovered_) {
      const auto across = [&](Index w) {
        if (state_[w] != kRim || w == left_[u] || w == right_[u]) return;
        ++across_[u];
        if (parent(w, 2) != v) ++across_[w];
      };
      fans_.neighbors(u, across);
    }
    if (uncovered_.empty()) {  // the edge from left to right was across
      --across_[l];
      --across_[r];
    }
    ready.insert(ready.end(), uncovered_.begin(), uncovered_.end());
    ready.push_back(l);
    ready.push_back(r);
  }

  Fans fans_;
  Triple corners_;
  std::vector<Index> left_, right_;  // along the rim, from the first corner to the second
  std::vector<State> state_;
  std::vector<Index> across_;  // edges across what is left
  std::vector<Index> uncovered_;
};

void check(const FacesRef& faces, Index n, const Triple& corners) {
  if (n < 3 || faces.rows() != 2 * static_cast<Eigen::Index>(n) - 5) refuse();
  if (faces.minCoeff() < 0 || faces.maxCoeff() >= n) refuse();
  const auto [a, b, c] = corners;
  if (std::min({a, b, c}) < 0 || std::max({a, b, c}) >= n || a == b || b == c || c == a) refuse();
}

}  // namespace

Points straight_drawing(const FacesRef& faces, Index n, const std::array<Index, 3>& corners) {
  check(faces, n, corners);
  const Trees trees(faces, n, corners);
  // In the trees to the first two corners parents go later than their children, in the third
  // earlier. Of each vertex: how many hang on it, itself among them, its distance from the corner,
  // and for each path how many hang on its vertices.
  Counts hanging = Counts::Ones(n, 3), depth = Counts::Zero(n, 3);
  std::array<Counts, 3> along{Counts::Zero(n, 3), Counts::Zero(n, 3), Counts::Zero(n, 3)};
  for (int tree = 0; tree < 3; ++tree) {
    std::vector<Index> upward = trees.order;
    if (tree == 2) std::reverse(upward.begin(), upward.end());
    for (const Index v : upward) {
      const Index up = trees.parent(v, tree);
      if (up >= 0) hanging(up, tree) += hanging(v, tree);
    }
  }
  for (int tree = 0; tree < 3; ++tree) {
    std::vector<Index> downward = trees.order;
    if (tree != 2) std::reverse(downward.begin(), downward.end());
    for (const Index v : downward) {
      const Index up = trees.parent(v, tree);
      if (up < 0) continue;
      depth(v, tree) = depth(up, tree) + 1;
      along[tree].row(v) = along[tree].row(up) + hanging.row(v);
    }
  }
  const double faces_in_all = 2.0 * n - 5.0;
  Points coordinates = Points::Zero(n, 3);
  for (const Index v : trees.order) {
    for (int region = 0; region < 3; ++region) {
      const int one = (region + 1) % 3, other = (region + 2) % 3;
      // Those in the region and at its rim hang on the paths round it in its own tree, v on both;
      // the corners at their ends hang on nothing. How many faces that makes, says Euler's formula.
      const std::int64_t vertices =
          along[one](v, region) + along[other](v, region) + 2 - hanging(v, region);
      const std::int64_t at_rim = depth(v, one) + depth(v, other) + 1;
      coordinates(v, region) = static_cast<double>(2 * vertices - at_rim - 2) / faces_in_all;
    }
  }
  for (int k = 0; k < 3; ++k) {
    coordinates.row(corners[k]).setZero();
    coordinates(corners[k], k) = 1.0;
  }
  return coordinates;
}

}  // namespace stretchmap::area
