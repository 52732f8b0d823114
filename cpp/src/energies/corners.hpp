// From derivatives by the edges of an element out of its first corner to those by all corners.
#pragma once

#include "stretchmap/energies/element_derivatives.hpp"

namespace stretchmap::energies {

// C corners; column a of `edges` and rows 3 a .. 3 a + 2 of derivatives belong to x_{a+1} - x_0.
template <int C>
struct EdgeDerivatives {
  static constexpr int kSize = 3 * (C - 1);
  Eigen::Matrix<double, 3, C - 1> edges;
  double value = 0.0;
  Eigen::Matrix<double, kSize, 1> gradient;
  Eigen::Matrix<double, kSize, kSize> hessian;
};

template <int C, class Elements>
void read_edges(const PointsRef& image, const Elements& elements, Index e,
                EdgeDerivatives<C>& local) {
  for (int a = 1; a < C; ++a)
    local.edges.col(a - 1) = image.row(elements(e, a)) - image.row(elements(e, 0));
}

inline ElementDerivatives room_for(Index elements, int corners, Order order) {
  const Index size = 3 * corners;
  return {Vec(elements), Rows(order >= kGradients ? elements : 0, size),
          Rows(order >= kHessians ? elements : 0, size * size)};
}

// Moving the first corner moves all edges the other way.
template <int C>
void write_row(const EdgeDerivatives<C>& local, Order order, Index e, ElementDerivatives& out) {
  constexpr int n = 3 * C;
  out.values[e] = local.value;
  if (order >= kGradients) {
    Eigen::Map<Eigen::Matrix<double, n, 1>> to(out.gradients.row(e).data());
    to.template tail<n - 3>() = local.gradient;
    to.template head<3>().setZero();
    for (int a = 1; a < C; ++a) to.template head<3>() -= to.template segment<3>(3 * a);
  }
  if (order >= kHessians) {
    Eigen::Map<Eigen::Matrix<double, n, n>> to(out.hessians.row(e).data());
    to.template bottomRightCorner<n - 3, n - 3>() = local.hessian;
    auto top = to.template topRightCorner<3, n - 3>();
    top.setZero();
    for (int a = 1; a < C; ++a) top -= to.template block<3, n - 3>(3 * a, 3);
    to.template bottomLeftCorner<n - 3, 3>() = top.transpose();
    auto first = to.template topLeftCorner<3, 3>();
    first.setZero();
    for (int a = 1; a < C; ++a) first -= to.template block<3, 3>(0, 3 * a);
  }
}

inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0;
  return m;
}

// \return columns: derivatives of the determinant by each column of M.
inline Eigen::Matrix3d cofactors(const Eigen::Matrix3d& M) {
  Eigen::Matrix3d out;
  for (int a = 0; a < 3; ++a) out.col(a) = M.col((a + 1) % 3).cross(M.col((a + 2) % 3));
  return out;
}

// to += factor * (second derivatives of det M by its columns).
inline void add_determinant_hessian(const Eigen::Matrix3d& M, double factor,
                                    Eigen::Matrix<double, 9, 9>& to) {
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    const Eigen::Matrix3d block = factor * cross_matrix(M.col(c));
    to.block<3, 3>(3 * a, 3 * b) -= block;
    to.block<3, 3>(3 * b, 3 * a) += block;
  }
}

}  // namespace stretchmap::energies
