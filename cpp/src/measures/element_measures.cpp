#include "stretchmap/measures/element_measures.hpp"

#include <algorithm>
#include <array>
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

namespace {

// Standard deviation of value(i), i of [0, n).
template <class Value>
double deviation(Index n, const Value& value) {
  const double mean = sum_chunks<1>(n,
                                    [&](Index begin, Index end, std::array<double, 1>& sum) {
                                      for (Index i = begin; i < end; ++i) sum[0] += value(i);
                                    })[0] /
                      n;
  const double square = sum_chunks<1>(n, [&](Index begin, Index end, std::array<double, 1>& sum) {
    for (Index i = begin; i < end; ++i) sum[0] += (value(i) - mean) * (value(i) - mean);
  })[0];
  return std::sqrt(square / n);
}

}  // namespace

ShareDeviations share_deviations(const Eigen::Ref<const IndexRows>& elements, const VecRef& source,
                                 const VecRef& rings, const VecRef& image) {
  constexpr Index kLeast = 16384, kMost = 8;  // elements of a part, parts
  const Index m = static_cast<Index>(elements.rows()), n = static_cast<Index>(rings.size());
  const Index parts = std::clamp(chunk_count(m, kLeast), Index{1}, kMost);
  const Index size = chunk_count(m, parts);
  const auto total = sum_chunks<2>(m, [&](Index begin, Index end, std::array<double, 2>& sum) {
    for (Index e = begin; e < end; ++e) sum[0] += source[e], sum[1] += image[e];
  });
  const double scale = total[0] / total[1];
  Eigen::MatrixXd sums(n, parts);  // of the image round each vertex
  for_tasks(parts, [&](Index part) {
    auto sum = sums.col(part);
    sum.setZero();
    for (Index e = part * size; e < std::min(m, (part + 1) * size); ++e)
      for (Index k = 0; k < elements.cols(); ++k) sum[elements(e, k)] += image[e];
  });
  for_rows(n, [&](Index i) { sums(i, 0) = sums.row(i).sum(); });
  return {deviation(n, [&](Index i) { return scale * sums(i, 0) / rings[i]; }),
          deviation(m, [&](Index e) { return scale * image[e] / source[e]; })};
}

Eigen::Matrix3d direction_scatter(const PointsRef& directions, const Eigen::Matrix3d& metric) {
  const Index n = static_cast<Index>(directions.rows());
  const auto sum = sum_chunks<9>(n, [&](Index begin, Index end, std::array<double, 9>& sums) {
    Eigen::Map<Eigen::Matrix3d> scatter(sums.data());
    for (Index i = begin; i < end; ++i) {
      const Vec3 d = directions.row(i);
      scatter += d * d.transpose() / d.dot(metric * d);
    }
  });
  return Eigen::Map<const Eigen::Matrix3d>(sum.data());
}

}  // namespace stretchmap::measures
