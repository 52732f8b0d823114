#include "stretchmap/forms/hodge.hpp"

#include <vector>

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
  std::vector<Eigen::Vector3d> vectors(k);
  for (Index f = 0; f < top.faces.rows(); ++f) {
    const FaceFrame frame = face_frame(top, points, f);
    for (Index l = 0; l < k; ++l) vectors[l] = face_vector(top, frame, f, forms.row(l));
    for (Index l = 0; l < k; ++l) {
      for (Index m = 0; m < k; ++m) {
        const Eigen::Vector3d star = frame.normal.cross(vectors[m]);
        products.star(l, m) += vectors[l].cross(star).dot(frame.normal) * frame.area;
        products.wedge(l, m) += vectors[l].cross(vectors[m]).dot(frame.normal) * frame.area;
      }
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
