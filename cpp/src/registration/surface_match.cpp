#include "stretchmap/registration/surface_match.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "stretchmap/area/triangle_energy.hpp"
#include "stretchmap/mesh/size.hpp"

namespace stretchmap::registration {
namespace {

Eigen::Matrix2d matrix_of(const RowsRef& rows, Index k) {
  Eigen::Matrix2d matrix;
  matrix << rows(k, 0), rows(k, 1), rows(k, 2), rows(k, 3);
  return matrix;
}

// Derivatives of phi for one face, given what a unit step of each corner's chart coordinates does
// to the edges of the image triangle.
struct FaceModel {
  Eigen::Matrix<double, 6, 1> gradient;
  Eigen::Matrix<double, 6, 6> hessian;
};

template <typename SlopeOfCorner>
FaceModel face_model(const Eigen::Matrix2d& P, const Eigen::Matrix2d& R,
                     const SlopeOfCorner& slope) {
  Eigen::Matrix2d stress;
  area::Matrix4 curvature;
  area::triangle_model(P * R, stress, curvature);
  Eigen::Matrix<double, 3, 2> G;
  G << 0.0, 0.0, R(0, 0), R(0, 1), R(1, 0), R(1, 1);
  G.row(0) = -(G.row(1) + G.row(2));
  Eigen::Matrix<double, 4, 6> D;  // of vec(K) by the chart coordinates of the corners
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 2; ++k) D.block<2, 2>(2 * k, 2 * c) = slope(c) * G(c, k);
  const Eigen::Map<const Eigen::Vector4d> flat(stress.data());
  return {D.transpose() * flat, D.transpose() * curvature * D};
}

// Sum over weights; term k is about face_of(k), and model_of(k) its share without the weight.
template <typename FaceOf, typename ModelOf>
MatchModel assemble(const area::SurfaceChart& chart, const VecRef& weights, const FaceOf& face_of,
                    const ModelOf& model_of) {
  const Index n = chart.n_vertices, m = static_cast<Index>(weights.size());
  MatchModel model{Vec::Zero(2 * n), SparseMatrix(2 * n, 2 * n)};
  std::vector<Eigen::Triplet<double, Index>> entries;
  entries.reserve(36 * static_cast<std::size_t>(m));
  for (Index k = 0; k < m; ++k) {
    const FaceModel face = model_of(k);
    const Index f = face_of(k);
    for (int p = 0; p < 6; ++p) {
      const Index row = 2 * chart.faces(f, p / 2) + p % 2;
      model.gradient[row] += weights[k] * face.gradient[p];
      for (int q = 0; q < 6; ++q)
        entries.emplace_back(row, 2 * chart.faces(f, q / 2) + q % 2,
                             weights[k] * face.hessian(p, q));
    }
  }
  model.hessian.setFromTriplets(entries.begin(), entries.end());
  return model;
}

template <typename ModelOfFace>
MatchModel assemble(const area::SurfaceChart& chart, const VecRef& weights,
                    const ModelOfFace& model_of) {
  return assemble(
      chart, weights, [](Index f) { return f; }, model_of);
}

}  // namespace

double face_value(const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                  const RowsRef& rest, Index f) {
  if (!(chart.edges(y, f).determinant() > 0.0)) return std::numeric_limits<double>::infinity();
  return area::triangle_value(mesh::plane_edges(X, chart.faces, f) * matrix_of(rest, f));
}

double match_value(const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                   const RowsRef& rest, const VecRef& weights) {
  double total = 0.0;
  for (Index f = 0; f < chart.faces.rows(); ++f) {
    const double value = face_value(chart, y, X, rest, f);
    if (!std::isfinite(value)) return value;
    total += weights[f] * value;
  }
  return total;
}

MatchModel match_model(const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                       const RowsRef& slopes, const RowsRef& rest, const VecRef& weights) {
  return assemble(chart, weights, [&](Index f) {
    const Eigen::Matrix2d P = mesh::plane_edges(X, chart.faces, f), R = matrix_of(rest, f);
    if (slopes.rows() == 0) {
      const Eigen::Matrix2d S = P * chart.edges(y, f).inverse();
      return face_model(P, R, [&](int) { return S; });
    }
    const Eigen::Vector3d a = (X.row(chart.faces(f, 1)) - X.row(chart.faces(f, 0))).transpose();
    const Eigen::Vector3d b = (X.row(chart.faces(f, 2)) - X.row(chart.faces(f, 0))).transpose();
    Eigen::Matrix<double, 3, 2> frame;
    frame.col(0) = a.normalized();
    frame.col(1) = (b - b.dot(frame.col(0)) * frame.col(0)).normalized();
    return face_model(P, R, [&](int c) -> Eigen::Matrix2d {
      const auto row = slopes.row(chart.faces(f, c));
      Eigen::Matrix<double, 3, 2> J;
      J << row[0], row[1], row[2], row[3], row[4], row[5];
      return frame.transpose() * J;
    });
  });
}

double cover_value(const area::SurfaceChart& chart, const Points2Ref& y, const IndexVecRef& home,
                   const RowsRef& metric, const RowsRef& rest, const VecRef& weights) {
  double total = 0.0;
  for (Index j = 0; j < home.size(); ++j)
    total += weights[j] * area::triangle_value(matrix_of(metric, j) * chart.edges(y, home[j]) *
                                               matrix_of(rest, home[j]));
  return total;
}

MatchModel cover_model(const area::SurfaceChart& chart, const Points2Ref& y,
                       const IndexVecRef& home, const RowsRef& metric, const RowsRef& rest,
                       const VecRef& weights) {
  return assemble(
      chart, weights, [&](Index j) { return home[j]; },
      [&](Index j) {
        const Eigen::Matrix2d Q = matrix_of(metric, j);
        return face_model(Q * chart.edges(y, home[j]), matrix_of(rest, home[j]),
                          [&](int) { return Q; });
      });
}

double flat_value(const area::SurfaceChart& chart, const Points2Ref& y,
                  const Eigen::Matrix2d& lattice, const RowsRef& rest, const VecRef& weights) {
  double total = 0.0;
  for (Index f = 0; f < chart.faces.rows(); ++f)
    total += weights[f] * area::triangle_value(lattice * chart.edges(y, f) * matrix_of(rest, f));
  return total;
}

MatchModel flat_model(const area::SurfaceChart& chart, const Points2Ref& y,
                      const Eigen::Matrix2d& lattice, const RowsRef& rest, const VecRef& weights) {
  return assemble(chart, weights, [&](Index f) {
    const Eigen::Matrix2d P = lattice * chart.edges(y, f);
    return face_model(P, matrix_of(rest, f), [&](int) { return lattice; });
  });
}

}  // namespace stretchmap::registration
