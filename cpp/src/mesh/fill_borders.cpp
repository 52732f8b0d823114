#include "stretchmap/mesh/fill_borders.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::mesh {
namespace {

using Loop = std::vector<Index>;
using Triangle = std::array<Index, 3>;

constexpr std::size_t kMost = 300;  // corners of a polygon that is triangulated in one piece
constexpr double kThin = 1e-3;      // area over longest side squared, below which it is avoided
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Loop> border_loops(const SurfaceTopology& top) {
  std::vector<Index> leaving(top.n_vertices, -1);  // border half-edge out of each vertex
  for (Index h = 0; h < top.twin.size(); ++h) {
    if (top.twin[h] >= 0) continue;
    Index& out = leaving[top.tail(h)];
    if (out >= 0) {
      throw Error("NonManifoldError", "the border passes through a vertex twice", {top.tail(h)});
    }
    out = h;
  }
  std::vector<Loop> loops;
  for (Index v = 0; v < top.n_vertices; ++v) {
    if (leaving[v] < 0) continue;
    Loop loop;
    for (Index i = v; leaving[i] >= 0;) {
      loop.push_back(i);
      i = top.head(std::exchange(leaving[i], -1));
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

class Filler {
 public:
  Filler(const PointsRef& points, const SurfaceTopology& top, const Poll& poll)
      : points_(points), poll_(poll) {
    std::vector<char> on_border(top.n_vertices, 0);
    for (Index h = 0; h < top.twin.size(); ++h) {
      if (top.twin[h] < 0) on_border[top.tail(h)] = 1;
    }
    for (Eigen::Index e = 0; e < top.edges.rows(); ++e) {
      const Index i = top.edges(e, 0), j = top.edges(e, 1);
      if (on_border[i] && on_border[j]) edges_.push_back({i, j});  // lexicographic, as `edges` is
    }
  }

  // Triangles over the corners of a polygon; false where there is no triangulation.
  bool fill(const Loop& polygon, std::vector<Triangle>& out) {
    if (poll_) poll_();
    if (polygon.size() <= kMost) return least_area(polygon, out);
    const auto [i, j] = short_diagonal(polygon);
    if (i == j) return false;
    const Loop inner(polygon.begin() + i, polygon.begin() + j + 1);
    Loop outer(polygon.begin(), polygon.begin() + i + 1);
    outer.insert(outer.end(), polygon.begin() + j, polygon.end());
    add_edge(polygon[i], polygon[j]);
    return fill(inner, out) && fill(outer, out);
  }

 private:
  using Edge = std::array<Index, 2>;

  static Edge sorted(Index i, Index j) { return {std::min(i, j), std::max(i, j)}; }

  void add_edge(Index i, Index j) {
    const Edge edge = sorted(i, j);
    edges_.insert(std::upper_bound(edges_.begin(), edges_.end(), edge), edge);
  }

  bool is_edge(Index i, Index j) const {
    return std::binary_search(edges_.begin(), edges_.end(), sorted(i, j));
  }

  // Area, and for a triangle that is next to flat the square of its longest side: in a plane all
  // triangulations have one area, also those with triangles over corners in one line.
  double cost(Index i, Index j, Index k) const {
    const Eigen::RowVector3d a = points_.row(i), b = points_.row(j), c = points_.row(k);
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const double longest =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    return area < kThin * longest ? area + longest : area;
  }

  // Shortest diagonal that leaves at least a quarter of the corners on either side.
  std::pair<std::size_t, std::size_t> short_diagonal(const Loop& polygon) const {
    const std::size_t n = polygon.size(), quarter = n / 4;
    std::pair<std::size_t, std::size_t> best{0, 0};
    double shortest = kInfinity;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = i + quarter; j < std::min(n, i + n - quarter); ++j) {
        const double length = (points_.row(polygon[i]) - points_.row(polygon[j])).squaredNorm();
        if (length < shortest && !is_edge(polygon[i], polygon[j])) {
          shortest = length;
          best = {i, j};
        }
      }
    }
    return best;
  }

  // Dynamic programming over the parts of the polygon between two of its corners.
  bool least_area(const Loop& polygon, std::vector<Triangle>& out) const {
    const Index n = static_cast<Index>(polygon.size());
    Eigen::MatrixXd least = Eigen::MatrixXd::Zero(n, n);
    Eigen::Matrix<Index, Eigen::Dynamic, Eigen::Dynamic> middle(n, n);
    for (Index span = 2; span < n; ++span) {
      for (Index i = 0; i + span < n; ++i) {
        const Index j = i + span;
        least(i, j) = kInfinity;
        if (span < n - 1 && is_edge(polygon[i], polygon[j])) continue;
        for (Index k = i + 1; k < j; ++k) {
          const double apart = least(i, k) + least(k, j);
          if (apart >= least(i, j)) continue;
          const double total = apart + cost(polygon[i], polygon[k], polygon[j]);
          if (total < least(i, j)) {
            least(i, j) = total;
            middle(i, j) = k;
          }
        }
      }
    }
    if (least(0, n - 1) == kInfinity) return false;
    std::vector<std::pair<Index, Index>> parts{{0, n - 1}};
    while (!parts.empty()) {
      const auto [i, j] = parts.back();
      parts.pop_back();
      if (j - i < 2) continue;
      const Index k = middle(i, j);
      out.push_back({polygon[j], polygon[k], polygon[i]});
      parts.push_back({i, k});
      parts.push_back({k, j});
    }
    return true;
  }

  const PointsRef& points_;
  const Poll& poll_;
  std::vector<Edge> edges_;
};

}  // namespace

BorderFill fill_borders(const PointsRef& points, const SurfaceTopology& top, const Poll& poll) {
  BorderFill fill;
  fill.loops = border_loops(top);
  Filler filler(points, top, poll);
  std::vector<Triangle> faces;
  std::vector<Index> hole;
  std::vector<Eigen::RowVector3d> centers;
  for (std::size_t l = 0; l < fill.loops.size(); ++l) {
    const Loop& loop = fill.loops[l];
    const std::size_t before = faces.size();
    if (!filler.fill(loop, faces)) {
      faces.resize(before);
      Eigen::RowVector3d center = Eigen::RowVector3d::Zero();
      for (const Index i : loop) center += points.row(i) / static_cast<double>(loop.size());
      const Index c = top.n_vertices + static_cast<Index>(centers.size());
      centers.push_back(center);
      for (std::size_t k = 0; k < loop.size(); ++k) {
        faces.push_back({loop[(k + 1) % loop.size()], loop[k], c});
      }
    }
    hole.resize(faces.size(), static_cast<Index>(l));
  }
  fill.faces.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    fill.faces.row(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
  }
  fill.hole = Eigen::Map<IndexVec>(hole.data(), static_cast<Eigen::Index>(hole.size()));
  fill.centers.resize(static_cast<Eigen::Index>(centers.size()), 3);
  for (std::size_t c = 0; c < centers.size(); ++c) {
    fill.centers.row(static_cast<Eigen::Index>(c)) = centers[c];
  }
  return fill;
}

}  // namespace stretchmap::mesh
