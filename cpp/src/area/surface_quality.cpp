#include "stretchmap/area/surface_quality.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"
#include "stretchmap/mesh/rounded_triangle.hpp"

namespace stretchmap::area {

namespace {

using Eigen::Matrix2d;

}  // namespace

SurfaceReference surface_reference(const PointsRef& points, const FacesRef& faces,
                                   double max_aspect) {
  SurfaceReference reference{Vec(faces.rows()), Points(faces.rows(), 3), {}};
  std::vector<Index> flat;
  for (Index f = 0; f < faces.rows(); ++f) {
    const Eigen::Vector3d a = points.row(faces(f, 1)) - points.row(faces(f, 0));
    const Eigen::Vector3d b = points.row(faces(f, 2)) - points.row(faces(f, 0));
    const double base = a.norm(), twice = a.cross(b).norm();
    reference.areas(f) = 0.5 * twice;
    if (!(twice > 0.0)) {
      flat.push_back(f);
      continue;
    }
    Matrix2d edges;
    edges << base, a.dot(b) / base, 0.0, twice / base;
    edges = mesh::rounded_triangle(edges, max_aspect);
    const Eigen::Vector2d p = edges.col(0), q = edges.col(1);
    reference.cotan.row(f) << p.dot(q) / twice, p.dot(p - q) / twice, q.dot(q - p) / twice;
  }
  if (!flat.empty()) throw Error("DegenerateError", "faces of the source have no area", flat);
  reference.areas /= reference.areas.sum();
  reference.weights = reference.areas.cwiseSqrt();
  reference.weights /= reference.weights.sum();
  return reference;
}

SurfaceQuality surface_quality(const SurfaceReference& reference, const FacesRef& faces,
                               const PointsRef& image) {
  const Index m = static_cast<Index>(faces.rows());
  Vec dirichlet(m), areas(m);  // |t| (s1^2 + s2^2) and image areas
  for_rows(m, [&](Index f) {
    Eigen::Vector3d p[3];
    for (int k = 0; k < 3; ++k) p[k] = image.row(faces(f, k));
    areas(f) = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    dirichlet(f) = 0.0;
    for (int k = 0; k < 3; ++k)
      dirichlet(f) += 0.5 * reference.cotan(f, k) * (p[(k + 2) % 3] - p[(k + 1) % 3]).squaredNorm();
  });
  const double total = areas.sum();
  const Eigen::ArrayXd ratio = areas.array() / (total * reference.areas.array());
  const Eigen::ArrayXd squares = dirichlet.array() / (total * reference.areas.array());
  const Eigen::ArrayXd angle = 0.5 * squares / ratio;
  SurfaceQuality quality;
  quality.energy =
      0.25 * (reference.areas.array() * squares * (1.0 + ratio.square().inverse())).sum();
  quality.face_std = std::sqrt((ratio - ratio.mean()).square().mean());
  quality.angle_mean = (reference.areas.array() * angle).sum();
  quality.angle_max = angle.maxCoeff();
  return quality;
}

namespace {

// The circle of the tube over one turn of the equal-area coordinate, tabulated: Kepler's equation
// once per entry instead of once per vertex and candidate. Error below 1e-6 of the tube's radius.
class TubeTable {
 public:
  explicit TubeTable(double ratio) : points_(kEntries + 1, 2) {
    const double tube = 1.0 / ratio, step = kTwoPi / kEntries;
    points_.row(0) << 1.0, 0.0;
    double v = 0.0;
    for (Index i = 1; i <= kEntries / 2; ++i) {
      const double slope = 1.0 + tube * points_(i - 1, 0);
      v = equal_area_angle(step * i, tube, v + step / slope);
      points_.row(i) << std::cos(v), std::sin(v);
      points_.row(kEntries - i) << points_(i, 0), -points_(i, 1);
    }
    points_.row(kEntries) = points_.row(0);
  }
  Eigen::RowVector2d at(double turns) const {
    const double x = kEntries * (turns - std::floor(turns));
    const Index i = std::min(static_cast<Index>(x), kEntries - 1);
    return points_.row(i) + (x - i) * (points_.row(i + 1) - points_.row(i));
  }

 private:
  static constexpr Index kEntries = 4096;
  Points2 points_;
};

}  // namespace

std::vector<SurfaceQuality> phase_qualities(const SurfaceReference& reference,
                                            const FacesRef& faces, const Points2Ref& turns,
                                            const Points2Ref& candidates) {
  std::map<double, std::optional<TubeTable>> by_ratio;
  for (Index i = 0; i < static_cast<Index>(candidates.rows()); ++i) by_ratio[candidates(i, 1)];
  std::vector<std::pair<const double, std::optional<TubeTable>>*> tables;
  for (auto& table : by_ratio) tables.push_back(&table);
  for_tasks(static_cast<Index>(tables.size()),
            [&](Index k) { tables[k]->second.emplace(tables[k]->first); });
  const Eigen::ArrayXd u = kTwoPi * turns.col(0).array();
  const Eigen::ArrayXd cos_u = u.cos(), sin_u = u.sin();
  std::vector<SurfaceQuality> result(static_cast<std::size_t>(candidates.rows()));
  for_tasks(static_cast<Index>(candidates.rows()), [&](Index i) {
    const TubeTable& table = *by_ratio.at(candidates(i, 1));
    Points image(turns.rows(), 3);
    for (Index k = 0; k < static_cast<Index>(turns.rows()); ++k) {
      const Eigen::RowVector2d tube = table.at(turns(k, 1) + candidates(i, 0));
      const double axis = candidates(i, 1) + tube.x();
      image.row(k) << axis * cos_u(k), axis * sin_u(k), tube.y();
    }
    result[i] = surface_quality(reference, faces, image);
  });
  return result;
}

}  // namespace stretchmap::area
