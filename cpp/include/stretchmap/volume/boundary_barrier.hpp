// Energy of the boundary triangles while their vertices glide on a surface.
//
// Let a be the area vector of the flat image triangle, N_k the surface's outward direction at its
// corners (k = 0, 1, 2) and at its centroid (k = 3), sigma_k = a . N_k over the rest area, and J
// (3x2) the Jacobian from the rest triangle. Then
//
//   phi = 1/4 sum_k [ |J|^2 / (2 chi_k) - 1 + (sigma_k^2 + 1) / (2 chi_k) - 1 ],
//
// or, on a surface that is not smooth at the scale of the triangles, the same with one direction
// only, the mean of those at the corners: triangles have to cut its edges, and at a sharp one no
// triangle faces as all its corners do. Here chi_k = chi(sigma_k) as in element_energy.hpp. For
// epsilon = 0 it is infinite as soon as a triangle faces inward at one of these points: what keeps
// the boundary image a graph over the surface. The tets alone do not see such a fold. |J|^2 / chi
// is convex in (J, chi), so the model Hessian, which drops the curvature of sigma only, is positive
// semi-definite without any projection.
#pragma once

#include <array>
#include <memory>

#include "stretchmap/mesh/size.hpp"
#include "stretchmap/volume/element_energy.hpp"
#include "stretchmap/volume/glide_surface.hpp"

namespace stretchmap::volume {

struct FaceReport {
  double energy = 0.0;  // +infinity where folded and epsilon = 0
  double facing = 1.0;  // least sigma_k
};

// The boundary triangles round gliding vertices, and what they glide on.
struct GlidingBoundary {
  std::shared_ptr<const GlideSurface> surface;
  Faces faces;  // (m, 3) vertices of the solid, all on the surface; some of them may be held
  Rows rest;    // (m, 4) as from rest_triangles
  Vec weights;  // (m)
};

class BoundaryBarrier {
 public:
  BoundaryBarrier() = default;
  explicit BoundaryBarrier(GlidingBoundary boundary) : boundary_(std::move(boundary)) {}

  Index size() const { return static_cast<Index>(boundary_.faces.rows()); }
  const Faces& faces() const { return boundary_.faces; }
  const GlideSurface& surface() const { return *boundary_.surface; }

  // \param x (n, 3) vertices, those of the face on the surface.
  // \param sites what the surface has at the vertices of the faces.
  // \return weighted energy of face f.
  FaceReport value(const PointsRef& x, const GlideSites& sites, Index f, double epsilon) const;

  // \param sites with frames.
  // \param gradient,hessian what the derivatives by steps of the three vertices along the first two
  //        axes of their frames are added to; no second ones if `hessian` is null.
  void model(const PointsRef& x, const GlideSites& sites, Index f, double epsilon,
             Eigen::Matrix<double, 6, 1>& gradient, Eigen::Matrix<double, 6, 6>* hessian) const;

 private:
  struct State;
  State state(const PointsRef& x, const GlideSites& sites, Index f) const;
  std::array<Eigen::Vector3d, 3> turned(const State& s, const GlideSites& sites, Index f,
                                        int k) const;

  GlidingBoundary boundary_;
};

// \param x (n, 3)
// \return (m) the least sigma_k of each face.
Vec least_facing(const GlidingBoundary& boundary, const PointsRef& x);

// As in rest_matrices, the shape of a sliver is not to be kept: it is clamped to `max_aspect`
// relative to the regular triangle, its area kept.
// \param scale image area over source area, by which the triangles are enlarged.
// \return (m, 4) inverse edge matrices, row-major, each in the triangle's own plane.
// \pre all faces have positive area.
Rows rest_triangles(const PointsRef& V, const FacesRef& faces, double scale, double max_aspect);

}  // namespace stretchmap::volume
