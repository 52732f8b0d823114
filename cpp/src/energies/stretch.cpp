#include <Eigen/Geometry>

#include "energies/corners.hpp"
#include "stretchmap/base/parallel.hpp"

namespace stretchmap::energies {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

template <int C, class Elements, class Evaluate>
ElementDerivatives for_elements(const PointsRef& image, const Elements& elements, Order order,
                                const Evaluate& evaluate) {
  const Index k = static_cast<Index>(elements.rows());
  ElementDerivatives out = room_for(k, C, order);
  for_chunks(k, [&](Index first, Index last) {
    EdgeDerivatives<C> local;
    for (Index e = first; e < last; ++e) {
      read_edges<C>(image, elements, e, local);
      evaluate(e, local);
      write_row<C>(local, order, e, out);
    }
  });
  return out;
}

}  // namespace

ElementDerivatives tet_stretch(const PointsRef& image, const TetsRef& tets,
                               const VecRef& rest_volumes, Order order) {
  return for_elements<4>(image, tets, order, [&](Index t, EdgeDerivatives<4>& local) {
    const Matrix3d slope = cofactors(local.edges) / 6.0;
    const double volume = local.edges.col(0).dot(slope.col(0));
    const double factor = 3.0 / rest_volumes[t];
    local.value = 0.5 * factor * volume * volume;
    if (order >= kGradients)
      local.gradient =
          factor * volume * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(slope.data());
    if (order >= kHessians) {
      const Eigen::Map<const Eigen::Matrix<double, 9, 1>> by(slope.data());
      local.hessian = factor * (by * by.transpose());
      add_determinant_hessian(local.edges, factor * volume / 6.0, local.hessian);
    }
  });
}

ElementDerivatives face_stretch(const PointsRef& image, const FacesRef& faces,
                                const VecRef& rest_areas, Order order) {
  return for_elements<3>(image, faces, order, [&](Index f, EdgeDerivatives<3>& local) {
    // |e1 x e2|^2 = |e1|^2 |e2|^2 - (e1 . e2)^2 is four times the squared area.
    const Vector3d a = local.edges.col(0), b = local.edges.col(1);
    const double factor = 0.25 / rest_areas[f], ab = a.dot(b);
    local.value = factor * a.cross(b).squaredNorm();
    if (order >= kGradients) {
      local.gradient.head<3>() = 2.0 * factor * (b.squaredNorm() * a - ab * b);
      local.gradient.tail<3>() = 2.0 * factor * (a.squaredNorm() * b - ab * a);
    }
    if (order >= kHessians) {
      const Matrix3d I = Matrix3d::Identity();
      auto& H = local.hessian;
      H.block<3, 3>(0, 0) = 2.0 * factor * (b.squaredNorm() * I - b * b.transpose());
      H.block<3, 3>(3, 3) = 2.0 * factor * (a.squaredNorm() * I - a * a.transpose());
      H.block<3, 3>(0, 3) = 2.0 * factor * (2.0 * a * b.transpose() - b * a.transpose() - ab * I);
      H.block<3, 3>(3, 0) = H.block<3, 3>(0, 3).transpose();
    }
  });
}

}  // namespace stretchmap::energies
