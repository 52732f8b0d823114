// A triangle mesh to glide on.
//
// Vertices move on its faces. Outward directions are interpolated between those of its vertices
// (Phong), so that they turn as smoothly as on the surface that the mesh stands for; within a face
// they and the derivatives below are smooth. A place is a face.
#pragma once

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/maps/surface_tree.hpp"
#include "stretchmap/volume/glide_surface.hpp"

namespace stretchmap::volume {

// What steps are taken along. Smooth axes are perpendicular to the outward direction and lead far
// over the surface that the mesh stands for; but where the faces slope against it and pressure is
// high, the energy may rise along them though its gradient says that it falls. Axes in the face are
// the derivative of `moved`; but they know nothing of the face beyond the next edge.
enum class MeshAxes { kSmooth, kFace };

class MeshSurface final : public GlideSurface {
 public:
  // \param points,faces (n, 3) and (m, 3), closed and oriented outward, copied.
  // \pre m > 0, no face without area.
  MeshSurface(const PointsRef& points, const FacesRef& faces, MeshAxes axes = MeshAxes::kSmooth);

  using GlideSurface::place;
  // \return the face closest to a point; if the point lies on the surface near the face `hint`, it
  //         is found from there.
  Index place(const Eigen::Vector3d& x, Index hint) const override;
  GlideSite site(const Eigen::Vector3d& x, Index hint, bool derivatives) const override;

  // All these look for the closest point along the surface from `place` on, as long as it comes
  // closer: another sheet of the surface is never taken, however near.
  Eigen::Matrix3d frame(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Vector3d outward(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Matrix3d outward_derivative(const Eigen::Vector3d& x, Index place) const override;
  Eigen::Vector3d moved(const Eigen::Vector3d& x, Index place,
                        const Eigen::Vector2d& step) const override;
  Eigen::Matrix2d bending(const Eigen::Vector3d& x, const GlideSite& site,
                          const Eigen::Vector3d& g) const override;
  bool smooth() const override { return false; }
  double area() const override { return area_; }

 private:
  maps::Foot near(const Eigen::Vector3d& x, Index place) const;
  maps::Foot located(const Eigen::Vector3d& x, Index hint) const;
  Eigen::Vector3d interpolated(const maps::Foot& foot) const;  // not of unit length
  Eigen::Vector3d outward_at(const maps::Foot& foot) const;
  Eigen::Matrix3d frame_at(const maps::Foot& foot) const;
  Eigen::Matrix3d derivative_at(const maps::Foot& foot) const;

  maps::SurfaceTree tree_;
  Incidence<> corners_;  // at each vertex
  Points normals_;       // (n, 3) of the vertices, by angles
  Points face_normals_;  // (m, 3)
  MeshAxes axes_;
  double area_ = 0.0;
};

}  // namespace stretchmap::volume
