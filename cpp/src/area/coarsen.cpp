#include "stretchmap/area/coarsen.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <queue>
#include <vector>

#include "area/cross.hpp"

namespace stretchmap::area {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Shift = Eigen::Matrix<Index, 1, 2>;

constexpr double kLeastQuality = 0.05;  // of a face, in space and in the chart; 1: equilateral
constexpr double kLeastCosine = 0.5;    // between the normals of a face before and after

struct Corner {
  Index vertex;
  Shift shift;
};
using Face = std::array<Corner, 3>;

double quality(double twice_area, double squares) {
  return squares > 0.0 ? 2.0 * 1.7320508075688772 * twice_area / squares : 0.0;
}

class Coarsener {
 public:
  Coarsener(const PointsRef& points, const SurfaceChart& chart, const Points2Ref& turns)
      : points_(points),
        turns_(turns),
        faces_(static_cast<std::size_t>(chart.faces.rows())),
        alive_(faces_.size(), 1),
        head_(faces_.size(), -1),
        stars_(static_cast<std::size_t>(chart.n_vertices)),
        next_(stars_.size(), -1),
        stamp_(stars_.size(), 0),
        shift_(Edges::Zero(chart.n_vertices, 2)) {
    for (Index f = 0; f < static_cast<Index>(faces_.size()); ++f)
      for (int k = 0; k < 3; ++k) {
        faces_[f][k] = {chart.faces(f, k), Shift(chart.shift_u(f, k), chart.shift_v(f, k))};
        stars_[chart.faces(f, k)].push_back(f);
      }
  }

  CoarseSurface run(Index n_faces) {
    Index left = static_cast<Index>(faces_.size());
    for (Index v = 0; v < static_cast<Index>(stars_.size()); ++v) push(v);
    while (left > n_faces && !queue_.empty()) {
      const Entry entry = queue_.top();
      queue_.pop();
      if (entry.stamp != stamp_[entry.vertex] || stars_[entry.vertex].empty()) continue;
      if (remove(entry.vertex)) left -= 2;
    }
    return result();
  }

 private:
  struct Entry {
    double size;
    Index vertex, stamp;
    bool operator<(const Entry& other) const {  // the smallest on top, ties by number
      return size > other.size || (size == other.size && vertex > other.vertex);
    }
  };

  // With a new size; older entries of the vertex no longer count.
  void push(Index v) {
    double size = 0.0;
    for (const Index f : stars_[v]) size += normal(faces_[f]).norm();
    queue_.push({size, v, ++stamp_[v]});
  }

  Vector3d normal(const Face& face) const {
    const Vector3d p = points_.row(face[0].vertex);
    return (points_.row(face[1].vertex).transpose() - p)
        .cross(points_.row(face[2].vertex).transpose() - p);
  }

  // Next to a vertex whose shift is nought in this frame.
  Vector2d place(const Corner& corner, Index origin) const {
    return (turns_.row(corner.vertex) - turns_.row(origin) + corner.shift.cast<double>())
        .transpose();
  }

  double chart_quality(const Face& face, Index origin) const {
    const Vector2d p = place(face[0], origin);
    const Vector2d a = place(face[1], origin) - p, b = place(face[2], origin) - p;
    return quality(cross(a, b), a.squaredNorm() + b.squaredNorm() + (b - a).squaredNorm());
  }

  double space_quality(const Face& face) const {
    double squares = 0.0;
    for (int k = 0; k < 3; ++k)
      squares +=
          (points_.row(face[k].vertex) - points_.row(face[(k + 1) % 3].vertex)).squaredNorm();
    return quality(normal(face).norm(), squares);
  }

  // The faces at v written so that v comes first and has no shift; their points along with them.
  void center(Index v) {
    for (const Index f : stars_[v]) {
      Face& face = faces_[f];
      const int first = face[0].vertex == v ? 0 : face[1].vertex == v ? 1 : 2;
      std::rotate(face.begin(), face.begin() + first, face.end());
      const Shift origin = face[0].shift;
      for (Corner& corner : face) corner.shift -= origin;
      for (Index p = head_[f]; p >= 0; p = next_[p]) shift_.row(p) -= origin;
    }
  }

  bool adjacent(Index a, Index b) const {
    return std::any_of(stars_[a].begin(), stars_[a].end(), [&](Index f) {
      const Face& face = faces_[f];
      return face[0].vertex == b || face[1].vertex == b || face[2].vertex == b;
    });
  }

  // Worst quality of the star after v is moved to `to`, 0 if that must not be.
  double worst_after(Index v, const Corner& to) const {
    int shared = 0;
    double worst = 1.0;
    for (const Index f : stars_[v]) {
      Face face = faces_[f];
      if (face[1].vertex == to.vertex || face[2].vertex == to.vertex) {
        const Corner& here = face[face[1].vertex == to.vertex ? 1 : 2];
        const Index opposite = face[face[1].vertex == to.vertex ? 2 : 1].vertex;
        if (here.shift != to.shift || stars_[opposite].size() < 4) return 0.0;
        ++shared;
        continue;
      }
      const Vector3d before = normal(face);
      face[0] = to;
      const Vector3d after = normal(face);
      if (!(before.dot(after) > kLeastCosine * before.norm() * after.norm())) return 0.0;
      worst = std::min({worst, space_quality(face), chart_quality(face, v)});
    }
    return shared == 2 && worst > kLeastQuality && !common_neighbor(v, to.vertex) ? worst : 0.0;
  }

  // Whether a vertex besides the two opposite ones is a neighbor of both.
  bool common_neighbor(Index v, Index other) const {
    int count = 0;
    for (const Index f : stars_[v])
      if (faces_[f][1].vertex != other && adjacent(faces_[f][1].vertex, other)) ++count;
    return count != 2;
  }

  bool remove(Index v) {
    center(v);
    Corner best{-1, Shift::Zero()};
    double worst = 0.0;
    for (const Index f : stars_[v])
      if (const double found = worst_after(v, faces_[f][1]); found > worst) {
        worst = found;
        best = faces_[f][1];
      }
    if (best.vertex < 0) return false;
    collapse(v, best);
    return true;
  }

  void collapse(Index v, const Corner& to) {
    std::vector<Index> ring, points{v}, fan;
    for (const Index f : stars_[v]) {
      ring.push_back(faces_[f][1].vertex);
      for (Index p = head_[f]; p >= 0; p = next_[p]) points.push_back(p);
      head_[f] = -1;
      if (faces_[f][1].vertex == to.vertex || faces_[f][2].vertex == to.vertex) {
        alive_[f] = 0;
        for (const Corner& corner : faces_[f])
          if (corner.vertex != v) leave(corner.vertex, f);
      } else {
        faces_[f][0] = to;
        stars_[to.vertex].push_back(f);
        fan.push_back(f);
      }
    }
    stars_[v].clear();
    stars_[v].shrink_to_fit();
    shift_.row(v).setZero();
    for (const Index p : points) {
      const Vector2d at = place({p, shift_.row(p)}, v);
      Index home = fan.front();
      double deepest = -1e300;
      for (const Index f : fan)
        if (const double depth = coordinates(faces_[f], v, at).minCoeff(); depth > deepest) {
          deepest = depth;
          home = f;
        }
      next_[p] = head_[home];
      head_[home] = p;
    }
    for (const Index w : ring) push(w);
  }

  void leave(Index v, Index f) {
    std::vector<Index>& star = stars_[v];
    star.erase(std::find(star.begin(), star.end(), f));
  }

  Vector3d coordinates(const Face& face, Index origin, const Vector2d& at) const {
    Vector2d x[3];
    for (int k = 0; k < 3; ++k) x[k] = place(face[k], origin) - at;
    const Vector3d w(cross(x[1], x[2]), cross(x[2], x[0]), cross(x[0], x[1]));
    return w / w.sum();
  }

  CoarseSurface result() {
    const Index n = static_cast<Index>(stars_.size());
    std::vector<Index> number(stars_.size(), -1), kept;
    for (Index v = 0; v < n; ++v)
      if (!stars_[v].empty()) {
        number[v] = static_cast<Index>(kept.size());
        kept.push_back(v);
      }
    const Index m = static_cast<Index>(std::count(alive_.begin(), alive_.end(), 1));
    CoarseSurface coarse{Eigen::Map<IndexVec>(kept.data(), kept.size()),
                         {static_cast<Index>(kept.size()), Faces(m, 3), Faces(m, 3), Faces(m, 3)},
                         IndexVec(n),
                         Points(n, 3),
                         Edges(n, 2)};
    Index to = 0;
    for (Index f = 0; f < static_cast<Index>(faces_.size()); ++f) {
      if (!alive_[f]) continue;
      const Face& face = faces_[f];
      const Shift origin = face[0].shift;
      for (int k = 0; k < 3; ++k) {
        coarse.chart.faces(to, k) = number[face[k].vertex];
        coarse.chart.shift_u(to, k) = face[k].shift.x() - origin.x();
        coarse.chart.shift_v(to, k) = face[k].shift.y() - origin.y();
        coarse.face(face[k].vertex) = to;
        coarse.weights.row(face[k].vertex) = Vector3d::Unit(k).transpose();
        coarse.shift.row(face[k].vertex) = face[k].shift - origin;
      }
      Face centered = face;
      for (Corner& corner : centered) corner.shift -= origin;
      for (Index p = head_[f]; p >= 0; p = next_[p]) {
        coarse.face(p) = to;
        coarse.shift.row(p) = shift_.row(p) - origin;
        const Vector2d at = place({p, coarse.shift.row(p)}, face[0].vertex);
        const Vector3d w = coordinates(centered, face[0].vertex, at).cwiseMax(0.0);
        coarse.weights.row(p) = (w / w.sum()).transpose();
      }
      ++to;
    }
    return coarse;
  }

  const PointsRef& points_;
  const Points2Ref& turns_;
  std::vector<Face> faces_;
  std::vector<char> alive_;
  std::vector<Index> head_;                // first point in each face, -1: none
  std::vector<std::vector<Index>> stars_;  // faces at a vertex; none: it was removed
  std::vector<Index> next_;                // next point in the same face
  std::vector<Index> stamp_;
  Edges shift_;  // of removed vertices, in the frame of the face they lie in
  std::priority_queue<Entry> queue_;
};

}  // namespace

CoarseSurface coarsen(const PointsRef& points, const SurfaceChart& chart, const Points2Ref& turns,
                      Index n_faces) {
  return Coarsener(points, chart, turns).run(n_faces);
}

}  // namespace stretchmap::area
