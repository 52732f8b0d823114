#include <algorithm>
#include <vector>

#include "area/cross.hpp"
#include "stretchmap/area/coarsen.hpp"
#include "stretchmap/base/incidence.hpp"

namespace stretchmap::area {

namespace {

constexpr int kSweeps = 40;

constexpr int kPatience = 4;  // sweeps after which one more ring is moved

void sort_unique(std::vector<Index>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

// Moves vertices of folded faces one by one, each to where the worst face of its star is best.
class Mender {
 public:
  Mender(const SurfaceChart& chart, Points2& turns)
      : chart_(chart), turns_(turns), corners_(corners_at(chart.faces, chart.n_vertices)) {}

  // The corners of the folded faces and of `rings` rings round them.
  void sweep(const std::vector<Index>& folded, int rings) {
    std::vector<Index> faces = folded, vertices;
    for (int ring = 0;; ++ring) {
      vertices.clear();
      for (const Index f : faces)
        for (int k = 0; k < 3; ++k) vertices.push_back(chart_.faces(f, k));
      sort_unique(vertices);
      if (ring == rings) break;
      for (const Index v : vertices)
        for (const Index h : corners_[v]) faces.push_back(h / 3);
      sort_unique(faces);
    }
    for (const Index v : vertices) improve(v);
  }

 private:
  void improve(Index v) {
    const Eigen::RowVector2d start = turns_.row(v);
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();  // of the star, from the vertex
    double count = 0.0;
    for (const Index h : corners_[v]) {
      middle += chart_.corner(turns_, h / 3, (h % 3 + 1) % 3) - chart_.corner(turns_, h / 3, h % 3);
      count += 1.0;
    }
    middle /= count;
    Eigen::RowVector2d best = start;
    double highest = worst(v);
    for (double t = 1.0; t > 0.05; t *= 0.5) {
      turns_.row(v) = start + t * middle.transpose();
      if (const double found = worst(v); found > highest) {
        highest = found;
        best = turns_.row(v);
      }
    }
    turns_.row(v) = best;
  }

  // Least area over squared edges of the faces at v.
  double worst(Index v) const {
    double least = 1.0;
    for (const Index h : corners_[v]) {
      const Eigen::Matrix2d e = chart_.edges(turns_, h / 3);
      const double squares = e.squaredNorm() + (e.col(1) - e.col(0)).squaredNorm();
      least = std::min(least, cross(Eigen::Vector2d(e.col(0)), Eigen::Vector2d(e.col(1))) /
                                  std::max(squares, 1e-300));
    }
    return least;
  }

  const SurfaceChart& chart_;
  Points2& turns_;
  Incidence<> corners_;
};

}  // namespace

Points2 prolong(const CoarseSurface& coarse, const SurfaceChart& chart, const Points2Ref& turns) {
  Points2 fine(coarse.face.size(), 2);
  for (Index i = 0; i < static_cast<Index>(fine.rows()); ++i) {
    Eigen::Vector2d at = -coarse.shift.row(i).cast<double>().transpose();
    for (int k = 0; k < 3; ++k)
      at += coarse.weights(i, k) * coarse.chart.corner(turns, coarse.face(i), k);
    fine.row(i) = at.transpose();
  }
  std::vector<Index> folded = folded_faces(chart, fine);
  if (folded.empty()) return fine;
  Mender mender(chart, fine);
  for (int sweep = 0; sweep < kSweeps && !folded.empty(); ++sweep) {
    mender.sweep(folded, sweep / kPatience);
    folded = folded_faces(chart, fine);
  }
  return folded.empty() ? fine : Points2(0, 2);
}

}  // namespace stretchmap::area
