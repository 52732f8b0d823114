#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "energies/corners.hpp"
#include "stretchmap/base/parallel.hpp"

namespace stretchmap::energies {
namespace {

using Eigen::Matrix3d;
using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using volume::ElementBatch;
using volume::EnergyWeights;
using volume::kLanes;

// With d = det J and I = tr J^T J the energy is a(d) I + b(d): value, first and second derivative.
struct Coefficients {
  double a, a1, a2, b1, b2;
};

Coefficients coefficients(double det, const EnergyWeights& w) {
  const auto [chi, first, second] = volume::regularized(det, w.epsilon);
  const double a = w.shape / (3.0 * std::pow(chi, 2.0 / 3.0));
  const double slope = -2.0 / 3.0 * first / chi;  // a' / a
  // b = volume * ((d^2 + 1) q / 2 - 1) with q = 1 / chi.
  const double q = 1.0 / chi, q1 = -first * q * q;
  const double q2 = (2.0 * first * first * q - second) * q * q;
  const double top = det * det + 1.0;
  return {a, a * slope,
          a * (slope * slope - 2.0 / 3.0 * (second / chi - first * first / (chi * chi))),
          w.volume * (det * q + 0.5 * top * q1), w.volume * (q + 2.0 * det * q1 + 0.5 * top * q2)};
}

// \return second derivatives of psi by the columns of J, nothing set to zero.
Matrix9 exact_hessian(const Matrix3d& J, const EnergyWeights& w) {
  const double squared = J.squaredNorm();
  const Coefficients c = coefficients(J.determinant(), w);
  const Matrix3d cofactor = cofactors(J);
  const Eigen::Map<const Vector9> g(cofactor.data()), j(J.data());
  Matrix9 H = (c.a2 * squared + c.b2) * g * g.transpose() +
              2.0 * c.a1 * (j * g.transpose() + g * j.transpose());
  H.diagonal().array() += 2.0 * c.a;
  add_determinant_hessian(J, c.a1 * squared + c.b1, H);
  return H;
}

// \param S the rest matrix, J = E S.
// \return the Hessian by the columns of the edge matrix E.
Matrix9 by_edges(const Matrix9& H, const Matrix3d& S) {
  Matrix9 half, whole;
  for (int a = 0; a < 3; ++a) {
    half.middleRows<3>(3 * a).setZero();
    for (int c = 0; c < 3; ++c) half.middleRows<3>(3 * a) += S(a, c) * H.middleRows<3>(3 * c);
  }
  for (int b = 0; b < 3; ++b) {
    whole.middleCols<3>(3 * b).setZero();
    for (int d = 0; d < 3; ++d) whole.middleCols<3>(3 * b) += S(b, d) * half.middleCols<3>(3 * d);
  }
  return whole;
}

Matrix9 projected_hessian(const ElementBatch& batch, int lane) {
  Matrix9 H;
  int at = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = a; b < 3; ++b, ++at)
      for (int i = 0; i < 9; ++i)
        H(3 * a + i / 3, 3 * b + i % 3) = H(3 * b + i % 3, 3 * a + i / 3) =
            batch.block[at][i][lane];
  return H;
}

}  // namespace

ElementDerivatives tet_distortion(const PointsRef& image, const TetsRef& tets, const RowsRef& rest,
                                  const VecRef& weights, const EnergyWeights& w, Order order,
                                  bool projected) {
  const Index k = static_cast<Index>(tets.rows());
  ElementDerivatives out = room_for(k, 4, order);
  const auto evaluate = order == kValues                  ? volume::element_values
                        : order == kHessians && projected ? volume::element_models
                                                          : volume::element_gradients;
  for_chunks(k, [&](Index begin, Index end) {
    ElementBatch batch;
    EdgeDerivatives<4> local;
    for (Index first = begin; first < end; first += kLanes) {
      for (int l = 0; l < kLanes; ++l) {
        const Index t = std::min(first + l, end - 1);
        read_edges<4>(image, tets, t, local);
        for (int i = 0; i < 9; ++i) {
          batch.edges[i][l] = local.edges.data()[i];
          batch.rest[i][l] = rest(t, i);
        }
        batch.weight[l] = weights[t];
      }
      evaluate(batch, w);
      for (Index t = first; t < std::min<Index>(first + kLanes, end); ++t) {
        const int l = static_cast<int>(t - first);
        read_edges<4>(image, tets, t, local);
        local.value = batch.energy[l];
        for (int i = 0; order >= kGradients && i < 9; ++i) local.gradient[i] = batch.gradient[i][l];
        if (order >= kHessians && projected) local.hessian = projected_hessian(batch, l);
        if (order >= kHessians && !projected) {
          const Matrix3d S = Eigen::Map<const volume::Block3>(rest.row(t).data());
          local.hessian = weights[t] * by_edges(exact_hessian(local.edges * S, w), S);
        }
        write_row<4>(local, order, t, out);
      }
    }
  });
  return out;
}

}  // namespace stretchmap::energies
