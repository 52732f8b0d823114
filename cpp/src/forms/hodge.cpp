#include "stretchmap/forms/hodge.hpp"

namespace stretchmap::forms {
namespace {

struct FaceFrame {
  Eigen::Matrix3d corners;  // columns
  Eigen::Vector3d normal;   // unit
  double area;
};

FaceFrame face_frame(const mesh::SurfaceTopology& top, const PointsRef& points, Index f) {
  FaceFrame frame;
  for (int k = 0; k < 3; ++k) frame.corners.col(k) = points.row(top.faces(f, k)).transpose();
  const Eigen::Vector3d cross = (frame.corners.col(1) - frame.corners.col(0))
                                    .cross(frame.corners.col(2) - frame.corners.col(0));
  frame.area = 0.5 * cross.norm();
  frame.normal = cross / (2.0 * frame.area);
  return frame;
}

// (3.6) with corners measured from corner 0, which a closed form does not notice.
template <class Form>
Eigen::Vector3d face_vector(const mesh::SurfaceTopology& top, const FaceFrame& frame, Index f,
                            const Form& form) {
  const auto along = [&](Index h) { return top.sign(h) * form[top.edge[h]]; };
  const Eigen::Vector3d sum = along(3 * f) * (frame.corners.col(2) - frame.corners.col(0)) +
                              along(3 * f + 2) * (frame.corners.col(1) - frame.corners.col(0));
  return sum.cross(frame.normal) / (2.0 * frame.area);
}

}  // namespace

Points form_vectors(const mesh::SurfaceTopology& top, const PointsRef& points, const VecRef& form) {
  Points vectors(top.faces.rows(), 3);
  for (Index f = 0; f < top.faces.rows(); ++f) {
    vectors.row(f) = face_vector(top, face_frame(top, points, f), f, form).transpose();
  }
  return vectors;
}

HodgeProducts hodge_products(const mesh::SurfaceTopology& top, const PointsRef& points,
                             const RowsRef& forms) {
  const Index k = static_cast<Index>(forms.rows());
  HodgeProducts products{Rows::Zero(k, k), Rows::Zero(k, k)};
  // Of all forms on a face: where the inner loop runs over forms, several go at once.
  Eigen::Array<double, Eigen::Dynamic, 3> vectors(k, 3), stars(k, 3);
  for (Index f = 0; f < top.faces.rows(); ++f) {
    const FaceFrame frame = face_frame(top, points, f);
    const Eigen::Vector3d& n = frame.normal;
    for (Index l = 0; l < k; ++l) {
      const Eigen::Vector3d vector = face_vector(top, frame, f, forms.row(l));
      vectors.row(l) = vector.transpose();
      stars.row(l) = n.cross(vector).transpose();
    }
    for (Index l = 0; l < k; ++l) {
      const double x = vectors(l, 0), y = vectors(l, 1), z = vectors(l, 2);
      const auto volumes = [&](const auto& v) {
        return ((y * v.col(2) - z * v.col(1)) * n[0] + (z * v.col(0) - x * v.col(2)) * n[1] +
                (x * v.col(1) - y * v.col(0)) * n[2]) *
               frame.area;
      };
      products.star.row(l).array() += volumes(stars).transpose();
      products.wedge.row(l).array() += volumes(vectors).transpose();
    }
  }
  return products;
}

Vec chart_areas(const mesh::SurfaceTopology& top, const VecRef& first, const VecRef& second) {
  Vec areas(top.faces.rows());
  for (Index f = 0; f < top.faces.rows(); ++f) {
    const auto along = [&](const VecRef& form, Index h) { return top.sign(h) * form[top.edge[h]]; };
    const Index h = 3 * f;
    areas[f] =
        0.5 * (along(first, h) * along(second, h + 1) - along(first, h + 1) * along(second, h));
  }
  return areas;
}

}  // namespace stretchmap::forms
