#include "stretchmap/partitions/split_tets.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <unordered_map>

namespace stretchmap::partitions {
namespace {

using Face = std::vector<Index>;
using Corner = Eigen::RowVector3d;

// Faces of a tet that look outwards.
constexpr int kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

Index floor_half(Index i) { return (i - (i & 1)) / 2; }

struct Cut {
  std::uint64_t edge;
  Index level;
  bool operator==(const Cut& other) const { return edge == other.edge && level == other.level; }
};

struct CutHash {
  std::size_t operator()(const Cut& c) const {
    const std::uint64_t odd = 0x9e3779b97f4a7c15ULL;
    return static_cast<std::size_t>((c.edge + static_cast<std::uint64_t>(c.level) * odd) * odd >>
                                    7);
  }
};

class Splitter {
 public:
  Splitter(const TetsRef& tets, Index n_vertices, const PlacesRef& places, Index period)
      : tets_(tets), places_(places), period_(period), next_(n_vertices) {}

  TetSplit run() {
    for (Index t = 0; t < tets_.rows(); ++t) split(t);
    TetSplit out;
    const Index k = static_cast<Index>(slab_.size());
    const Index c = static_cast<Index>(level_.size());
    out.tets = Eigen::Map<const Tets>(tet_.data(), k, 4);
    out.slab = Eigen::Map<const IndexVec>(slab_.data(), k);
    out.parent = Eigen::Map<const IndexVec>(parent_.data(), k);
    out.cut_edges = Eigen::Map<const Edges>(edge_.data(), c, 2);
    out.cut_level = Eigen::Map<const IndexVec>(level_.data(), c);
    return out;
  }

 private:
  Index reduced(Index i) const { return (i % period_ + period_) % period_; }

  Index cut(Index a, Index b, Index level) {
    if (a > b) std::swap(a, b);
    level = reduced(level);
    const std::uint64_t key = (static_cast<std::uint64_t>(a) << 32) | static_cast<std::uint64_t>(b);
    const auto [entry, is_new] = cuts_.try_emplace(Cut{key, level}, next_);
    if (is_new) {
      ++next_;
      edge_.insert(edge_.end(), {a, b});
      level_.push_back(level);
    }
    return entry->second;
  }

  void add(const std::array<Index, 4>& v, Index slab, Index parent) {
    tet_.insert(tet_.end(), v.begin(), v.end());
    slab_.push_back(reduced(slab));
    parent_.push_back(parent);
  }

  // A convex piece given by its outward faces: cones from its lowest vertex over the faces away
  // from it, each face cut into a fan from its own lowest vertex. Two pieces cut a common face
  // alike.
  void add_piece(const std::vector<Face>& faces, Index slab, Index parent) {
    Index apex = faces[0][0];
    for (const Face& face : faces)
      apex = std::min(apex, *std::min_element(face.begin(), face.end()));
    for (const Face& face : faces) {
      if (std::find(face.begin(), face.end(), apex) != face.end()) continue;
      const std::size_t n = face.size();
      const std::size_t first =
          static_cast<std::size_t>(std::min_element(face.begin(), face.end()) - face.begin());
      for (std::size_t i = 1; i + 1 < n; ++i)
        add({apex, face[first], face[(first + i) % n], face[(first + i + 1) % n]}, slab, parent);
    }
  }

  // Whether a level, given by its place, separates two corners.
  bool between(Index t, int p, int q, Index place) const {
    const Index a = places_(t, p), b = places_(t, q);
    return a != kEverywhere && b != kEverywhere && std::min(a, b) < place && place < std::max(a, b);
  }

  // The part of a face of a tet between two levels.
  Face clipped(Index t, const int (&corners)[3], Index low, Index high) {
    Face face;
    for (int i = 0; i < 3; ++i) {
      const int p = corners[i], q = corners[(i + 1) % 3];
      const Index place = places_(t, p);
      if (place == kEverywhere || (low <= place && place <= high)) face.push_back(tets_(t, p));
      Index crossed[2] = {low, high};
      if (places_(t, q) < place) std::swap(crossed[0], crossed[1]);
      for (const Index at : crossed)
        if (between(t, p, q, at)) face.push_back(cut(tets_(t, p), tets_(t, q), floor_half(at)));
    }
    return face;
  }

  // The section of a tet with a level that separates some of its corners, looking up.
  Face section(Index t, Index place) {
    static const Corner at[4] = {Corner::Zero(), Corner::UnitX(), Corner::UnitY(), Corner::UnitZ()};
    Face face;
    std::array<Corner, 4> points;
    const auto push = [&](Index id, const Corner& point) {
      points[face.size()] = point;
      face.push_back(id);
    };
    int low = -1, high = -1;
    for (int p = 0; p < 4; ++p) {
      const Index here = places_(t, p);
      if (here == kEverywhere || here == place) push(tets_(t, p), at[p]);
      if (here != kEverywhere && here < place) low = p;
      if (here != kEverywhere && here > place) high = p;
    }
    constexpr int kEdges[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
    for (const auto& [p, q] : kEdges)
      if (between(t, p, q, place))
        push(cut(tets_(t, p), tets_(t, q), floor_half(place)), (at[p] + at[q]) / 2);
    if (face.size() == 4) {
      // Edges in their order: the first and the last of four that are cut have no corner in common.
      std::swap(points[2], points[3]);
      std::swap(face[2], face[3]);
    }
    const Corner normal = (points[1] - points[0]).cross(points[2] - points[0]);
    if (normal.dot(at[high] - at[low]) < 0) std::reverse(face.begin(), face.end());
    return face;
  }

  void split(Index t) {
    Index low = std::numeric_limits<Index>::max(), high = kEverywhere;
    for (int p = 0; p < 4; ++p)
      if (places_(t, p) != kEverywhere) {
        low = std::min(low, places_(t, p));
        high = std::max(high, places_(t, p));
      }
    if (high == kEverywhere) low = high = 0;
    const Index first = floor_half(low + 1), last = floor_half(high);
    if (first >= last) {
      add({tets_(t, 0), tets_(t, 1), tets_(t, 2), tets_(t, 3)}, last, t);
      return;
    }
    Face below;
    for (Index slab = first; slab <= last; ++slab) {
      std::vector<Face> faces;
      for (const auto& corners : kFaces) {
        Face face = clipped(t, corners, 2 * slab - 1, 2 * slab + 1);
        if (face.size() > 2) faces.push_back(std::move(face));
      }
      if (slab > first) faces.emplace_back(below.rbegin(), below.rend());
      if (slab < last) {
        below = section(t, 2 * slab + 1);
        faces.push_back(below);
      }
      add_piece(faces, slab, t);
    }
  }

  const TetsRef& tets_;
  const PlacesRef& places_;
  Index period_, next_;
  std::unordered_map<Cut, Index, CutHash> cuts_;
  std::vector<Index> tet_, slab_, parent_, edge_, level_;
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

TetSplit split_tets(const TetsRef& tets, Index n_vertices, const PlacesRef& places, Index period) {
  return Splitter(tets, n_vertices, places, period).run();
}

Vec shares_below(const CornersRef& values) {
  Vec shares(values.rows());
  for (Index t = 0; t < values.rows(); ++t)
    shares[t] = share_below({values(t, 0), values(t, 1), values(t, 2), values(t, 3)});
  return shares;
}

double volume_below(const TetsRef& tets, const VecRef& volumes, const VecRef& values) {
  long double total = 0.0L;
  for (Index t = 0; t < tets.rows(); ++t)
    total += volumes[t] * share_below({values[tets(t, 0)], values[tets(t, 1)], values[tets(t, 2)],
                                       values[tets(t, 3)]});
  return static_cast<double>(total);
}

}  // namespace stretchmap::partitions
