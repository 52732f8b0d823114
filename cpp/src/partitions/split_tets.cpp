#include "stretchmap/partitions/split_tets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace stretchmap::partitions {
namespace {

constexpr double kSnap = 1e-9;

using Face = std::vector<Index>;

// Vertices of a tet with the negative ones first, then those on the level, then the positive ones,
// reached by an even permutation; always possible, two of the four being alike.
struct Sorted {
  std::array<Index, 4> v;
  int negative = 0, zero = 0, positive = 0;
};

Sorted sort_tet(const TetsRef& tets, Index t, const std::vector<signed char>& sign) {
  Sorted s;
  for (int a = 0; a < 4; ++a) s.v[a] = tets(t, a);
  const auto of = [&](int a) { return sign[static_cast<std::size_t>(s.v[a])]; };
  bool odd = false;
  for (int end = 3; end > 0; --end)
    for (int a = 0; a < end; ++a)
      if (of(a) > of(a + 1)) {
        std::swap(s.v[a], s.v[a + 1]);
        odd = !odd;
      }
  for (int a = 0; odd && a < 3; ++a)
    if (of(a) == of(a + 1)) {
      std::swap(s.v[a], s.v[a + 1]);
      odd = false;
    }
  for (int a = 0; a < 4; ++a) ++(of(a) < 0 ? s.negative : of(a) > 0 ? s.positive : s.zero);
  return s;
}

class Splitter {
 public:
  Splitter(const TetsRef& tets, const VecRef& values, const VecRef& gate)
      : tets_(tets), values_(values), gate_(gate), next_(static_cast<Index>(values.size())) {
    snap();
  }

  TetSplit run() {
    for (Index t = 0; t < tets_.rows(); ++t) split(t);
    TetSplit out;
    const Index k = static_cast<Index>(side_.size());
    out.tets = Eigen::Map<const Tets>(tet_.data(), k, 4);
    out.side = Eigen::Map<const IndexVec>(side_.data(), k);
    out.parent = Eigen::Map<const IndexVec>(parent_.data(), k);
    out.cut_edges = Eigen::Map<const Edges>(edge_.data(), static_cast<Index>(weight_.size()), 2);
    out.cut_weight = Eigen::Map<const Vec>(weight_.data(), static_cast<Index>(weight_.size()));
    return out;
  }

 private:
  void snap() {
    sign_.resize(static_cast<std::size_t>(values_.size()));
    for (Index i = 0; i < values_.size(); ++i)
      sign_[static_cast<std::size_t>(i)] =
          static_cast<signed char>((values_[i] > 0.0) - (values_[i] < 0.0));
    for (Index t = 0; t < tets_.rows(); ++t)
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b) {
          const double p = values_[tets_(t, a)], q = values_[tets_(t, b)];
          if ((p > 0.0) != (q > 0.0) && std::abs(p) < kSnap * std::abs(q))
            sign_[static_cast<std::size_t>(tets_(t, a))] = 0;
        }
  }

  Index cut(Index a, Index b) {
    if (a > b) std::swap(a, b);
    const std::uint64_t key = (static_cast<std::uint64_t>(a) << 32) | static_cast<std::uint64_t>(b);
    const auto [entry, is_new] = cuts_.try_emplace(key, next_);
    if (is_new) {
      ++next_;
      edge_.insert(edge_.end(), {a, b});
      weight_.push_back(values_[a] / (values_[a] - values_[b]));
    }
    return entry->second;
  }

  void add(const std::array<Index, 4>& v, Index side, Index parent) {
    tet_.insert(tet_.end(), v.begin(), v.end());
    side_.push_back(side);
    parent_.push_back(parent);
  }

  // A convex piece given by its outward faces: cones from its lowest vertex over the faces away
  // from it, each face cut into a fan from its own lowest vertex. Two pieces cut a common face
  // alike.
  void add_piece(const std::vector<Face>& faces, Index side, Index parent) {
    Index apex = faces[0][0];
    for (const Face& face : faces)
      apex = std::min(apex, *std::min_element(face.begin(), face.end()));
    for (const Face& face : faces) {
      if (std::find(face.begin(), face.end(), apex) != face.end()) continue;
      const std::size_t n = face.size();
      const std::size_t first =
          static_cast<std::size_t>(std::min_element(face.begin(), face.end()) - face.begin());
      for (std::size_t i = 1; i + 1 < n; ++i)
        add({apex, face[first], face[(first + i) % n], face[(first + i + 1) % n]}, side, parent);
    }
  }

  bool gated_off(const Sorted& s) const {
    if (gate_.size() == 0) return false;
    double sum = 0.0;
    for (const Index a : s.v)
      for (const Index b : s.v)
        if (values_[a] < 0.0 && values_[b] > 0.0) {
          const double w = values_[a] / (values_[a] - values_[b]);
          sum += (1.0 - w) * gate_[a] + w * gate_[b];
        }
    return !(sum > 0.0);
  }

  void split(Index t) {
    const Sorted s = sort_tet(tets_, t, sign_);
    if (s.negative == 0 || s.positive == 0 || gated_off(s)) {
      Index side = s.positive > 0 ? 1 : -1;
      if (s.negative > 0 && s.positive > 0) {
        double largest = 0.0;
        for (const Index a : s.v)
          if (std::abs(values_[a]) > std::abs(largest)) largest = values_[a];
        side = largest > 0.0 ? 1 : -1;
      }
      add({tets_(t, 0), tets_(t, 1), tets_(t, 2), tets_(t, 3)}, side, t);
    } else if (s.zero == 2) {
      const Index c = cut(s.v[0], s.v[3]);
      add({s.v[0], s.v[1], s.v[2], c}, -1, t);
      add({c, s.v[1], s.v[2], s.v[3]}, 1, t);
    } else if (s.zero == 1) {
      split_at_vertex(s, t);
    } else if (s.negative == 2) {
      split_two_two(s, t);
    } else {
      split_corner(s, t);
    }
  }

  // One vertex on one side, one on the level, two on the other side.
  void split_at_vertex(const Sorted& s, Index t) {
    const bool low = s.negative == 1;
    // (lone, level, x, y), an even permutation of (v0, v1, v2, v3).
    const std::array<Index, 4> p = low ? std::array<Index, 4>{s.v[0], s.v[1], s.v[2], s.v[3]}
                                       : std::array<Index, 4>{s.v[3], s.v[2], s.v[1], s.v[0]};
    const Index side = low ? -1 : 1, x = cut(p[0], p[2]), y = cut(p[0], p[3]);
    add({p[0], p[1], x, y}, side, t);
    add_piece(
        {{y, p[3], p[2], x}, {p[1], p[2], p[3]}, {y, p[1], p[3]}, {x, p[2], p[1]}, {p[1], y, x}},
        -side, t);
  }

  // One vertex against three.
  void split_corner(const Sorted& s, Index t) {
    const bool low = s.negative == 1;
    const std::array<Index, 4> p = low ? s.v : std::array<Index, 4>{s.v[3], s.v[2], s.v[1], s.v[0]};
    const Index side = low ? -1 : 1;
    const Index x = cut(p[0], p[1]), y = cut(p[0], p[2]), z = cut(p[0], p[3]);
    add({p[0], x, y, z}, side, t);
    add_piece(
        {{p[1], p[2], p[3]}, {x, z, y}, {y, p[2], p[1], x}, {z, p[3], p[2], y}, {x, p[1], p[3], z}},
        -side, t);
  }

  void split_two_two(const Sorted& s, Index t) {
    const auto& v = s.v;
    const Index a = cut(v[0], v[2]), b = cut(v[0], v[3]), c = cut(v[1], v[2]), d = cut(v[1], v[3]);
    add_piece({{v[1], c, d}, {v[0], b, a}, {v[0], v[1], d, b}, {v[0], a, c, v[1]}, {c, a, b, d}},
              -1, t);
    add_piece({{c, v[2], v[3], d}, {b, v[3], v[2], a}, {d, v[3], b}, {a, v[2], c}, {d, b, a, c}}, 1,
              t);
  }

  const TetsRef& tets_;
  const VecRef& values_;
  const VecRef& gate_;
  Index next_;
  std::vector<signed char> sign_;
  std::unordered_map<std::uint64_t, Index> cuts_;
  std::vector<Index> tet_, side_, parent_, edge_;
  std::vector<double> weight_;
};

// Share of a tet in which the function is negative, from its four values in ascending order.
double share_below(std::array<double, 4> g) {
  std::sort(g.begin(), g.end());
  if (g[3] <= 0.0) return 1.0;
  if (g[0] >= 0.0) return 0.0;
  const auto at = [&](int i, int j) { return g[i] / (g[i] - g[j]); };
  if (g[1] >= 0.0) return at(0, 1) * at(0, 2) * at(0, 3);
  if (g[2] < 0.0) return 1.0 - at(3, 0) * at(3, 1) * at(3, 2);
  const double t02 = at(0, 2), t03 = at(0, 3), t12 = at(1, 2), t13 = at(1, 3);
  return t12 * t13 + t02 * t03 * (1.0 - t13) + t02 * t13 * (1.0 - t12);
}

}  // namespace

TetSplit split_tets(const TetsRef& tets, const VecRef& values, const VecRef& gate) {
  return Splitter(tets, values, gate).run();
}

double volume_below(const TetsRef& tets, const VecRef& volumes, const VecRef& values) {
  long double total = 0.0L;
  for (Index t = 0; t < tets.rows(); ++t)
    total += volumes[t] * share_below({values[tets(t, 0)], values[tets(t, 1)], values[tets(t, 2)],
                                       values[tets(t, 3)]});
  return static_cast<double>(total);
}

}  // namespace stretchmap::partitions
