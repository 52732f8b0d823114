// Energy of a map from one surface to another, given by where the vertices go in a chart of the
// target: the polyhedron of the image points against the source,
//
//   Psi(y) = sum_f weight_f phi(K_f),  K_f = P_f(X(y)) rest_f,
//
// phi that of triangle_energy.hpp, P_f the edges of the image triangle in its own plane.
// Derivatives hold the metric S_f = P_f E_f^-1 fixed, E_f being the edges in the chart.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/stretch/chart.hpp"

namespace stretchmap {

// Psi for chart positions y (n, 2) and points X (n, 3); +infinity if a face is folded in the chart.
// rest (m, 4): inverse edge matrices as of rest_triangles; weights (m).
double match_value(const SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                   const RowsRef& rest, const VecRef& weights);

struct MatchModel {
  Vec gradient;          // (2 n) by (y_0, y_1) of each vertex
  SparseMatrix hessian;  // (2 n, 2 n), positive semi-definite
};

// \pre match_value is finite.
MatchModel match_model(const SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                       const RowsRef& rest, const VecRef& weights);

}  // namespace stretchmap
