// Energy of the boundary triangles while their vertices glide on the torus.
//
// Let a be the area vector of the flat image triangle, N_k the outward direction from the torus'
// core circle at its corners (k = 0, 1, 2) and at its centroid (k = 3), sigma_k = a . N_k over the
// rest area, and J (3x2) the Jacobian from the rest triangle. Then
//
//   phi = 1/4 sum_k [ |J|^2 / (2 chi_k) - 1 + (sigma_k^2 + 1) / (2 chi_k) - 1 ],
//
// with chi_k = chi(sigma_k) as in element_energy.hpp. For epsilon = 0 it is infinite as soon as a
// triangle faces inward at one of these points: what keeps the boundary image a graph over the
// torus. The tets alone do not see such a fold. |J|^2 / chi is convex in (J, chi), so the model
// Hessian, which drops the curvature of sigma only, is positive semi-definite without any
// projection.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::volume {

struct FaceReport {
  double energy = 0.0;  // +infinity where folded and epsilon = 0
  double facing = 1.0;  // least sigma_k
};

class BoundaryBarrier {
 public:
  BoundaryBarrier() = default;

  // faces (m, 3) index vertices of the solid; rest (m, 4) as from rest_triangles; weights (m);
  // R and r are the radii of the torus.
  BoundaryBarrier(Faces faces, Rows rest, Vec weights, double R, double r);

  Index size() const { return static_cast<Index>(faces_.rows()); }
  const Faces& faces() const { return faces_; }

  // Weighted energy of face f for vertices x (n, 3) on the torus.
  FaceReport value(const PointsRef& x, Index f, double epsilon) const;

  // Adds to `gradient` and `hessian` the derivatives by arc length along the coordinate circles
  // (u, v) of the three vertices.
  void linearise(const PointsRef& x, Index f, double epsilon, Eigen::Matrix<double, 6, 1>& gradient,
                 Eigen::Matrix<double, 6, 6>& hessian) const;

 private:
  struct State;
  State state(const PointsRef& x, Index f) const;

  Faces faces_;
  Rows rest_;
  Vec weights_;
  double R_ = 1.0, r_ = 0.5;
};

// Inverse edge matrices (m, 4), row-major, of the triangles, each in its own plane and enlarged so
// that the total area grows by the factor `scale` (image area over source area).
// \pre all faces have positive area.
Rows rest_triangles(const PointsRef& V, const FacesRef& faces, double scale);

}  // namespace stretchmap::volume
