#include "stretchmap/measures/element_measures.hpp"

#include <cmath>
#include <limits>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::measures {
namespace {

using Vec3 = Eigen::Vector3d;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A triangle laid into the plane with its first edge on the x-axis: edge lengths and area.
struct FlatTriangle {
  double x1, x2, y2;  // corners (0, 0), (x1, 0), (x2, y2)
  double area;
};

FlatTriangle lay_flat(const Vec3& e1, const Vec3& e2) {
  const double length = e1.norm();
  const double twice_area = e1.cross(e2).norm();
  if (length == 0.0) return {0.0, 0.0, 0.0, 0.0};
  return {length, e1.dot(e2) / length, twice_area / length, 0.5 * twice_area};
}

}  // namespace

ElementMeasures face_measures(const PointsRef& points, const FacesRef& faces,
                              const PointsRef& image, const VecRef& sign) {
  const Eigen::Index m = faces.rows();
  ElementMeasures out{Vec(m), Vec(m), Vec(m), Vec(m)};
  for_rows(static_cast<Index>(m), kElementChunk, [&](Index f) {
    const auto edge = [&](const PointsRef& x, int k) -> Vec3 {
      return x.row(faces(f, k)) - x.row(faces(f, 0));
    };
    const FlatTriangle s = lay_flat(edge(points, 1), edge(points, 2));
    const FlatTriangle t = lay_flat(edge(image, 1), edge(image, 2));
    // The affine map is upper triangular in these frames. Its parts that turn and that mirror
    // have the norms (s1 + s2) / 2 and (s1 - s2) / 2, without the cancellation of the Gram
    // matrix.
    const double j11 = t.x1 / s.x1;
    const double j12 = (t.x2 - j11 * s.x2) / s.y2;
    const double j22 = sign[f] * t.y2 / s.y2;
    const double turn = 0.5 * std::hypot(j11 + j22, j12);
    const double mirror = 0.5 * std::hypot(j11 - j22, j12);
    out.source[f] = s.area;
    out.image[f] = sign[f] * t.area;
    out.angle[f] = out.image[f] > 0.0 ? (turn + mirror) / (turn - mirror) : kInfinity;
    out.conformal[f] = 2.0 * s.area * mirror * mirror;
  });
  return out;
}

ElementMeasures tet_measures(const PointsRef& points, const TetsRef& tets, const PointsRef& image) {
  const Eigen::Index m = tets.rows();
  ElementMeasures out{Vec(m), Vec(m), Vec(m), Vec()};
  for_rows(static_cast<Index>(m), kElementChunk, [&](Index t) {
    const auto edge = [&](const PointsRef& x, int k) -> Vec3 {
      return x.row(tets(t, k)) - x.row(tets(t, 0));
    };
    const Vec3 a = edge(points, 1), b = edge(points, 2), c = edge(points, 3);
    const Vec3 p = edge(image, 1), q = edge(image, 2), r = edge(image, 3);
    const Vec3 bc = b.cross(c), ca = c.cross(a), ab = a.cross(b);
    const double det_source = a.dot(bc), det_image = p.dot(q.cross(r));
    out.source[t] = det_source / 6.0;
    out.image[t] = det_image / 6.0;
    const Eigen::Matrix3d jacobian =
        (p * bc.transpose() + q * ca.transpose() + r * ab.transpose()) / det_source;
    const double det = det_image / det_source;
    const double root = std::cbrt(det);
    out.angle[t] = det > 0.0 ? jacobian.squaredNorm() / (3.0 * root * root) : kInfinity;
  });
  return out;
}

Vec ring_sums(const Eigen::Ref<const IndexRows>& elements, const VecRef& values, Index n_vertices) {
  Vec sums = Vec::Zero(n_vertices);
  for (Eigen::Index e = 0; e < elements.rows(); ++e) {
    for (Eigen::Index k = 0; k < elements.cols(); ++k) sums[elements(e, k)] += values[e];
  }
  return sums;
}

}  // namespace stretchmap::measures
