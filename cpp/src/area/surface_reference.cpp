#include "stretchmap/area/surface_reference.hpp"

#include <cmath>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
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

double mean_angle_distortion(const SurfaceReference& reference, const FacesRef& faces,
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
  return 0.5 * (reference.areas.array() * dirichlet.array() / areas.array()).sum();
}

}  // namespace stretchmap::area
