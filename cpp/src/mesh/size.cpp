#include "stretchmap/mesh/size.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::mesh {
namespace {

constexpr double kFlat = 1e-12;
constexpr double kRounding = 16 * std::numeric_limits<double>::epsilon();

template <class Elements>
double longest_edge(const PointsRef& points, const Elements& elements, Index e) {
  double longest = 0;
  for (Index i = 0; i < elements.cols(); ++i) {
    for (Index j = 0; j < i; ++j) {
      longest = std::max(longest,
                         (points.row(elements(e, i)) - points.row(elements(e, j))).squaredNorm());
    }
  }
  return std::sqrt(longest);
}

}  // namespace

Points face_area_vectors(const PointsRef& points, const FacesRef& faces) {
  Points vectors(faces.rows(), 3);
  for (Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d a = points.row(faces(f, 0));
    const Eigen::RowVector3d b = points.row(faces(f, 1)) - a;
    const Eigen::RowVector3d c = points.row(faces(f, 2)) - a;
    vectors.row(f) = 0.5 * b.cross(c);
  }
  return vectors;
}

Eigen::Matrix2d plane_edges(const PointsRef& points, const FacesRef& faces, Index f) {
  const Eigen::RowVector3d a = points.row(faces(f, 1)) - points.row(faces(f, 0));
  const Eigen::RowVector3d b = points.row(faces(f, 2)) - points.row(faces(f, 0));
  const double base = a.norm();
  Eigen::Matrix2d edges;
  edges << base, a.dot(b) / base, 0.0, a.cross(b).norm() / base;
  return edges;
}

Vec face_areas(const PointsRef& points, const FacesRef& faces) {
  return face_area_vectors(points, faces).rowwise().norm();
}

Vec tet_volumes(const PointsRef& points, const TetsRef& tets) {
  const Index k = static_cast<Index>(tets.rows());
  Vec volumes(k);
  for_rows(k, [&](Index t) {
    const Eigen::RowVector3d a = points.row(tets(t, 0));
    const Eigen::RowVector3d b = points.row(tets(t, 1)) - a;
    const Eigen::RowVector3d c = points.row(tets(t, 2)) - a;
    const Eigen::RowVector3d d = points.row(tets(t, 3)) - a;
    volumes[t] = b.dot(c.cross(d)) / 6.0;
  });
  return volumes;
}

double enclosed_volume(const PointsRef& points, const FacesRef& faces) {
  const Eigen::RowVector3d center = points.colwise().mean();
  double volume = 0;
  for (Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d a = points.row(faces(f, 0)) - center;
    const Eigen::RowVector3d b = points.row(faces(f, 1)) - center;
    const Eigen::RowVector3d c = points.row(faces(f, 2)) - center;
    volume += a.cross(b).dot(c);
  }
  return volume / 6;
}

Eigen::Array<bool, Eigen::Dynamic, 1> degenerate_faces(const PointsRef& points,
                                                       const FacesRef& faces) {
  const double rounding = kRounding * points.cwiseAbs().maxCoeff();
  const Vec areas = face_areas(points, faces);
  Eigen::Array<bool, Eigen::Dynamic, 1> flat(faces.rows());
  for (Index f = 0; f < faces.rows(); ++f) {
    const double edge = longest_edge(points, faces, f);
    flat[f] = !(2 * areas[f] > std::max(kFlat * edge, rounding) * edge);
  }
  return flat;
}

Eigen::Array<bool, Eigen::Dynamic, 1> degenerate_tets(const PointsRef& points,
                                                      const TetsRef& tets) {
  const double rounding = kRounding * points.cwiseAbs().maxCoeff();
  const Vec volumes = tet_volumes(points, tets);
  Eigen::Array<bool, Eigen::Dynamic, 1> flat(tets.rows());
  for_rows(static_cast<Index>(tets.rows()), [&](Index t) {
    const double edge = longest_edge(points, tets, t);
    flat[t] = !(6 * std::abs(volumes[t]) > std::max(kFlat * edge, rounding) * edge * edge);
  });
  return flat;
}

Vec edge_lengths(const SurfaceTopology& top, const PointsRef& points) {
  Vec length(top.edges.rows());
  for (Index e = 0; e < length.size(); ++e) {
    length[e] = (points.row(top.edges(e, 1)) - points.row(top.edges(e, 0))).norm();
  }
  return length;
}

}  // namespace stretchmap::mesh
