// Energy of the boundary triangles while their vertices glide on the torus.
//
// Triangles are measured in the equal-area chart (R u, r s), s = v + (r / R) sin v, whose area
// element is that of the torus: a triangle folds exactly when its chart area changes sign, and a
// sum of face_energy over all triangles is a barrier against that. A tet alone does not see such a
// fold.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/stretch/element_energy.hpp"

namespace stretchmap {

class BoundaryBarrier {
 public:
  BoundaryBarrier() = default;

  // faces (m, 3) index vertices of the solid; rest (m, 4) are row-major 2x2 inverse edge matrices
  // of the source triangles, scaled so that det K = 1 means equal area; weights (m).
  BoundaryBarrier(Faces faces, Rows rest, Vec weights, double R, double r);

  Index size() const { return static_cast<Index>(faces_.rows()); }
  const Faces& faces() const { return faces_; }

  // Weighted energy of face f for vertices x (n, 3) on the torus; +infinity if it is folded.
  double value(const PointsRef& x, Index f) const;

  // Adds to `gradient` (6) and `hessian` (6, 6): derivatives by arc length along the coordinate
  // circles (u, v) of the three vertices, the Hessian positive semi-definite.
  void linearise(const PointsRef& x, Index f, Eigen::Matrix<double, 6, 1>& gradient,
                 Eigen::Matrix<double, 6, 6>& hessian) const;

 private:
  Eigen::Matrix2d jacobian(const PointsRef& x, Index f) const;

  Faces faces_;
  Rows rest_;
  Vec weights_;
  double R_ = 1.0, r_ = 0.5;
};

// Inverse edge matrices (m, 4) of the triangles, each in its own plane, as BoundaryBarrier wants
// them. `scale` is image area over source area.
// \pre all faces have positive area.
Rows rest_triangles(const PointsRef& V, const FacesRef& faces, double scale);

}  // namespace stretchmap
