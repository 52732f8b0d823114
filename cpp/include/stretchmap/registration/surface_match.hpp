// Energy of a map from one surface to another, given by where the vertices go in a chart of the
// target: the polyhedron of the image points against the source,
//
//   Psi(y) = sum_f weight_f phi(K_f),  K_f = P_f(X(y)) rest_f,
//
// phi that of triangle_energy.hpp, P_f the edges of the image triangle in its own plane.
#pragma once

#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::registration {

// \param y (n, 2) chart positions.
// \param X (n, 3) points there.
// \param rest (m, 4) inverse edge matrices as of rest_triangles.
// \return phi of face f, +infinity if it is folded in the chart.
double face_value(const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                  const RowsRef& rest, Index f);

// \param weights (m)
// \return Psi, +infinity if a face is folded.
double match_value(const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                   const RowsRef& rest, const VecRef& weights);

struct MatchModel {
  Vec gradient;          // (2 n) by (y_0, y_1) of each vertex
  SparseMatrix hessian;  // (2 n, 2 n), positive semi-definite
};

// Derivatives by y. What a step dy does to the edges of an image triangle is modeled in one of two
// ways:
//   tangent  dX = slope dy at each corner; slopes (n, 6) are row-major 3x2 matrices;
//   chord    dP_f = S_f dE_f with the metric S_f = P_f E_f^-1 of the whole triangle, E_f its edges
//   in
//            the chart; slopes (0, 6). Coarser, but it sees farther than one face of the target.
// How the metric changes along the step is left out of the Hessian.
// \pre match_value is finite.
MatchModel match_model(const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
                       const RowsRef& slopes, const RowsRef& rest, const VecRef& weights);

// The energy as the target sees it. A triangle of the image that spans a process of the target is
// small, however much of the target it stands for, so that Psi would have processes cut off. Here
// each sample of the target, in face `home` of the source's image, weighs what the map does there,
//
//   Phi(y) = sum_j weight_j phi(Q_j E_f rest_f),  f = home_j,
//
// Q_j the target's face as it lies in the chart, E_f the edges of f there: no chord is taken.
// \param metric (q, 4) row-major 2x2 matrices Q_j, of positive determinant.
// \return +infinity if a home is folded.
double cover_value(const area::SurfaceChart& chart, const Points2Ref& y, const IndexVecRef& home,
                   const RowsRef& metric, const RowsRef& rest, const VecRef& weights);

// Derivatives while samples stay in their homes. \pre cover_value is finite.
MatchModel cover_model(const area::SurfaceChart& chart, const Points2Ref& y,
                       const IndexVecRef& home, const RowsRef& metric, const RowsRef& rest,
                       const VecRef& weights);

// The same energy as Psi for the map into the plane, where the target is the flat torus itself: P_f
// is lattice * E_f. \param lattice the two periods as columns.
double flat_value(const area::SurfaceChart& chart, const Points2Ref& y,
                  const Eigen::Matrix2d& lattice, const RowsRef& rest, const VecRef& weights);

// \pre flat_value is finite.
MatchModel flat_model(const area::SurfaceChart& chart, const Points2Ref& y,
                      const Eigen::Matrix2d& lattice, const RowsRef& rest, const VecRef& weights);

}  // namespace stretchmap::registration
