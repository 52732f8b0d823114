#include "stretchmap/resample/boundary_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::resample {
namespace {

using Eigen::RowVector3d;
using Eigen::RowVector4d;
using Eigen::Vector3d;

constexpr Index kSamplesPerChunk = 512;
constexpr int kTurns = 8;

// Share of the way from a to b where that segment is closest to y.
double closest_share(const RowVector3d& a, const RowVector3d& b, const RowVector3d& y) {
  const RowVector3d along = b - a;
  const double squared = along.squaredNorm();
  return squared > 0.0 ? std::clamp((y - a).dot(along) / squared, 0.0, 1.0) : 0.0;
}

// A point of a bilinear patch, close to y if the one it starts from is: along its two families of
// straight lines in turn. A warped quad is far from any triangles between its corners.
struct PatchPoint {
  double s, t;
  RowVector3d at, facing;

  PatchPoint(const std::array<RowVector3d, 4>& corner, const RowVector4d& start,
             const RowVector3d& y)
      : s(start[1] + start[2]), t(start[2] + start[3]) {
    const auto mean = [](const RowVector3d& a, const RowVector3d& b, double w) -> RowVector3d {
      return a + w * (b - a);
    };
    for (int turn = 0; turn < kTurns; ++turn) {
      s = closest_share(mean(corner[0], corner[3], t), mean(corner[1], corner[2], t), y);
      t = closest_share(mean(corner[0], corner[1], s), mean(corner[3], corner[2], s), y);
    }
    const RowVector3d low = mean(corner[0], corner[1], s), high = mean(corner[3], corner[2], s);
    at = mean(low, high, t);
    facing = (mean(corner[1], corner[2], t) - mean(corner[0], corner[3], t)).cross(high - low);
  }

  RowVector4d weights() const {
    return {(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t};
  }
};

}  // namespace

BoundaryFit::BoundaryFit(const PointsRef& points, const FacesRef& faces, const PointsRef& normals,
                         const IndexVecRef& sample_faces, const PointsRef& sample_weights,
                         const TetsRef& quads, int per_side, double far, bool bilinear)
    : surface_(points, faces),
      normals_(normals),
      quads_(quads),
      per_side_(per_side),
      far_(far),
      bilinear_(bilinear) {
  find_places();
  const Index s = static_cast<Index>(sample_faces.size());
  near_.assign(places_.size() + s, 0);
  sites_.setZero(s, 3);
  site_normals_.resize(s, 3);
  for (Index j = 0; j < s; ++j) {
    const Index f = sample_faces[j];
    for (int c = 0; c < 3; ++c) sites_.row(j) += sample_weights(j, c) * points.row(faces(f, c));
    site_normals_.row(j) = normal(f, sample_weights.row(j).transpose());
  }
}

// Corners and edges belong to several quads, and are looked at once.
void BoundaryFit::find_places() {
  const Index n = static_cast<Index>(quads_.rows()), per = per_side_ * per_side_;
  const int last = per_side_ - 1;
  std::map<std::array<Index, 3>, Index> shared;
  place_of_.resize(n * per);
  for (Index b = 0; b < n; ++b) {
    for (int k = 0; k < per; ++k) {
      const int i = k % per_side_, j = k / per_side_;
      const bool on_i = i == 0 || i == last, on_j = j == 0 || j == last;
      const auto corner = [&](bool high_i, bool high_j) {
        return quads_(b, high_j ? (high_i ? 2 : 3) : (high_i ? 1 : 0));
      };
      const Index fresh = static_cast<Index>(places_.size());
      Index& place = place_of_[per * b + k];
      place = fresh;
      if (on_i || on_j) {
        const Index begin = corner(on_i && i == last, on_j && j == last),
                    end = corner(on_i ? i == last : true, on_j ? j == last : true);
        const int along = begin == end ? 0 : (on_i ? j : i);
        const std::array<Index, 3> key = begin <= end
                                             ? std::array<Index, 3>{begin, end, along}
                                             : std::array<Index, 3>{end, begin, last - along};
        place = shared.try_emplace(key, fresh).first->second;
      }
      if (place == fresh) places_.push_back({b, k});
    }
  }
}

RowVector3d BoundaryFit::normal(Index face, const Vector3d& weights) const {
  RowVector3d sum = RowVector3d::Zero();
  for (int c = 0; c < 3; ++c) sum += weights[c] * normals_.row(surface_.faces()(face, c));
  return sum.normalized();
}

// A short gap has the normal's direction but for rounding and the faces' edges; a long one, from a
// tip the grid does not reach to its end, has not, and tangent planes of the tip's sides would hold
// nothing.
RowVector3d BoundaryFit::direction(const RowVector3d& normal, const RowVector3d& gap) const {
  const double t = gap.squaredNorm() / (gap.squaredNorm() + far_ * far_);
  const RowVector3d sum = (1.0 - t) * normal + (gap.dot(normal) < 0.0 ? -t : t) * gap.normalized();
  return sum.normalized();
}

FitSamples BoundaryFit::match(const PointsRef& x) {
  FitSamples out;
  const Index q = static_cast<Index>(places_.size());
  const Index s = q + static_cast<Index>(sites_.rows());
  out.first_of_surface = q;
  out.corners.resize(s, 4);
  out.weights.resize(s, 4);
  out.point.resize(s, 3);
  out.normal.resize(s, 3);
  out.share.setZero(s);
  out.distance.resize(s);
  match_quads(x, out);
  match_surface(x, out);
  return out;
}

void BoundaryFit::match_quads(const PointsRef& x, FitSamples& out) {
  const Index n = static_cast<Index>(quads_.rows()), per = per_side_ * per_side_;
  const Index q = out.first_of_surface;
  const double step = 1.0 / (per_side_ - 1);
  for_chunks(q, kSamplesPerChunk, [&](Index begin, Index end) {
    for (Index j = begin; j < end; ++j) {
      const Place& place = places_[j];
      const double s = (place.sample % per_side_) * step, t = (place.sample / per_side_) * step;
      const RowVector4d w((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t);
      Vector3d here = Vector3d::Zero();
      for (int c = 0; c < 4; ++c) here += w[c] * x.row(quads_(place.quad, c)).transpose();
      const maps::Foot foot = surface_.closest(here, near_[j]);
      near_[j] = foot.face;
      out.corners.row(j) = quads_.row(place.quad);
      out.weights.row(j) = w;
      out.point.row(j) = foot.point.transpose();
      out.normal.row(j) =
          direction(normal(foot.face, foot.weights), here.transpose() - out.point.row(j));
      out.distance[j] = std::sqrt(foot.squared_distance);
    }
  });
  for (Index b = 0; b < n; ++b) {
    const RowVector3d d1 = x.row(quads_(b, 2)) - x.row(quads_(b, 0)),
                      d2 = x.row(quads_(b, 3)) - x.row(quads_(b, 1));
    const double area = 0.5 * d1.cross(d2).norm();
    for (Index k = 0; k < per; ++k) out.share[place_of_[per * b + k]] += area / per;
  }
  out.share.head(q) /= out.share.head(q).sum();
}

void BoundaryFit::match_surface(const PointsRef& x, FitSamples& out) {
  const Index n = static_cast<Index>(x.rows()), q = static_cast<Index>(quads_.rows());
  Points points(n + q, 3);
  points.topRows(n) = x;
  Faces fans(4 * q, 3);
  for (Index b = 0; b < q; ++b) {
    points.row(n + b).setZero();
    for (int c = 0; c < 4; ++c) {
      points.row(n + b) += 0.25 * x.row(quads_(b, c));
      fans.row(4 * b + c) << quads_(b, c), quads_(b, (c + 1) % 4), n + b;
    }
  }
  const maps::SurfaceTree grid(points, fans);
  const Index s = static_cast<Index>(sites_.rows()), first = out.first_of_surface;
  for_chunks(s, kSamplesPerChunk, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Index j = first + i;
      const maps::Foot foot = grid.closest(sites_.row(i).transpose(), near_[j]);
      near_[j] = foot.face;
      const Index quad = foot.face / 4, c = foot.face % 4;
      RowVector4d w = RowVector4d::Constant(0.25 * foot.weights[2]);
      w[c] += foot.weights[0];
      w[(c + 1) % 4] += foot.weights[1];
      RowVector3d at = foot.point.transpose(), facing;
      if (bilinear_) {
        std::array<RowVector3d, 4> corner;
        for (int k = 0; k < 4; ++k) corner[k] = x.row(quads_(quad, k));
        const PatchPoint there(corner, w, sites_.row(i));
        w = there.weights();
        at = there.at;
        facing = there.facing;
      } else {
        const auto corner = [&](int k) -> RowVector3d { return points.row(fans(foot.face, k)); };
        facing = (corner(1) - corner(0)).cross(corner(2) - corner(0));
      }
      const RowVector3d gap = at - sites_.row(i);
      out.corners.row(j) = quads_.row(quad);
      out.weights.row(j) = w;
      out.point.row(j) = sites_.row(i);
      out.normal.row(j) = direction(site_normals_.row(i), gap);
      out.distance[j] = gap.norm();
      out.share[j] = facing.dot(site_normals_.row(i)) > 0.0 ? 1.0 / s : 0.0;
    }
  });
}

}  // namespace stretchmap::resample
