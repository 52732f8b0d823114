#include "stretchmap/stretch/surface_quality.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/stretch/chart.hpp"

namespace stretchmap {

namespace {
constexpr double kTwoPi = 6.283185307179586476925287;
}

SurfaceReference surface_reference(const PointsRef& points, const FacesRef& faces) {
  SurfaceReference reference{Vec(faces.rows()), Points(faces.rows(), 3)};
  std::vector<Index> flat;
  for (Index f = 0; f < faces.rows(); ++f) {
    Eigen::Vector3d p[3];
    for (int k = 0; k < 3; ++k) p[k] = points.row(faces(f, k));
    const double area = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    if (!(area > 0.0)) flat.push_back(f);
    reference.areas(f) = area;
    for (int k = 0; k < 3; ++k)
      reference.cotan(f, k) = (p[(k + 1) % 3] - p[k]).dot(p[(k + 2) % 3] - p[k]) / (2.0 * area);
  }
  if (!flat.empty()) throw Error("DegenerateError", "faces of the source have no area", flat);
  reference.areas /= reference.areas.sum();
  return reference;
}

SurfaceQuality surface_quality(const SurfaceReference& reference, const FacesRef& faces,
                               const PointsRef& image) {
  const Index m = static_cast<Index>(faces.rows());
  Vec dirichlet(m), areas(m);  // |t| (s1^2 + s2^2) and image areas
  for (Index f = 0; f < m; ++f) {
    Eigen::Vector3d p[3];
    for (int k = 0; k < 3; ++k) p[k] = image.row(faces(f, k));
    areas(f) = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    dirichlet(f) = 0.0;
    for (int k = 0; k < 3; ++k)
      dirichlet(f) += 0.5 * reference.cotan(f, k) * (p[(k + 2) % 3] - p[(k + 1) % 3]).squaredNorm();
  }
  const double total = areas.sum();
  const Eigen::ArrayXd ratio = areas.array() / (total * reference.areas.array());
  const Eigen::ArrayXd squares = dirichlet.array() / (total * reference.areas.array());
  const Eigen::ArrayXd angle = 0.5 * squares / ratio;
  SurfaceQuality quality;
  quality.energy =
      0.25 * (reference.areas.array() * squares * (1.0 + ratio.square().inverse())).sum();
  quality.face_sd = std::sqrt((ratio - ratio.mean()).square().mean());
  quality.angle_mean = (reference.areas.array() * angle).sum();
  quality.angle_max = angle.maxCoeff();
  return quality;
}

Points torus_image(const Points2Ref& turns, double phase, double ratio) {
  const double tube = 1.0 / (kTwoPi * std::sqrt(ratio));  // area 4 pi^2 ratio tube^2 = 1
  const Vec s = kTwoPi * (turns.col(1).array() + phase);
  const Eigen::ArrayXd v = angle_from_equal_area(s, 1.0 / ratio).array();
  const Eigen::ArrayXd u = kTwoPi * turns.col(0).array();
  const Eigen::ArrayXd axis = tube * (ratio + v.cos());
  Points image(turns.rows(), 3);
  image.col(0) = axis * u.cos();
  image.col(1) = axis * u.sin();
  image.col(2) = tube * v.sin();
  return image;
}

std::vector<SurfaceQuality> phase_qualities(const SurfaceReference& reference,
                                            const FacesRef& faces, const Points2Ref& turns,
                                            const Points2Ref& candidates) {
  std::vector<SurfaceQuality> result(static_cast<std::size_t>(candidates.rows()));
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < candidates.rows(); ++i)
    result[i] =
        surface_quality(reference, faces, torus_image(turns, candidates(i, 0), candidates(i, 1)));
  return result;
}

}  // namespace stretchmap
