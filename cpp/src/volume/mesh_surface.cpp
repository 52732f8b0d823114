#include "stretchmap/volume/mesh_surface.hpp"

#include <algorithm>
#include <cmath>

#include "stretchmap/mesh/size.hpp"

namespace stretchmap::volume {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using maps::Foot;

namespace {

constexpr int kMostFaces = 64;        // crossed on the way to the closest point
constexpr double kOnSurface = 1e-24;  // squared distance over the area: nothing can be closer
constexpr double kOpposed = 1e-6;     // normals at the corners of a face that cancel tell nothing

// The rotation by the least angle that takes one direction to another turns the axes: they vary
// smoothly with the normal everywhere but at the opposite of this direction, which is chosen to be
// none that a scanned body is likely to face.
const Vector3d kPole = Vector3d(1.0, std::sqrt(2.0), std::sqrt(3.0)) / std::sqrt(6.0);
const Vector3d kFirst = Vector3d(std::sqrt(2.0), -1.0, 0.0) / std::sqrt(3.0);

Matrix3d axes_of(const Vector3d& normal) {
  const double c = kPole.dot(normal);
  Matrix3d axes;
  axes.col(2) = normal;
  if (1.0 + c < 1e-9) {
    axes.col(0) = kFirst;
  } else {
    // kFirst is perpendicular to the pole.
    axes.col(0) = kFirst - kFirst.dot(normal) / (1.0 + c) * (kPole + normal);
    axes.col(0) -= axes.col(0).dot(normal) * normal;
    axes.col(0).normalize();
  }
  axes.col(1) = normal.cross(axes.col(0));
  return axes;
}

Points vertex_normals(const PointsRef& points, const FacesRef& faces) {
  Points normals = Points::Zero(points.rows(), 3);
  for (Index f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const Vector3d at = points.row(faces(f, k));
      const Vector3d a = points.row(faces(f, (k + 1) % 3)).transpose() - at;
      const Vector3d b = points.row(faces(f, (k + 2) % 3)).transpose() - at;
      const Vector3d cross = a.cross(b);
      normals.row(faces(f, k)) += std::atan2(cross.norm(), a.dot(b)) * cross.normalized();
    }
  }
  normals.rowwise().normalize();
  return normals;
}

}  // namespace

MeshSurface::MeshSurface(const PointsRef& points, const FacesRef& faces, MeshAxes axes)
    : tree_(points, faces),
      corners_(corners_at(faces, static_cast<Index>(points.rows()))),
      normals_(vertex_normals(points, faces)),
      face_normals_(mesh::face_area_vectors(points, faces)),
      axes_(axes) {
  for (Index f = 0; f < face_normals_.rows(); ++f) area_ += face_normals_.row(f).norm();
  face_normals_.rowwise().normalize();
}

Index MeshSurface::place(const Vector3d& x, Index hint) const { return located(x, hint).face; }

// The closest point. Of another sheet, too, unless x lies on this one.
Foot MeshSurface::located(const Vector3d& x, Index hint) const {
  if (hint < 0) return tree_.closest(x);
  const Foot foot = near(x, hint);
  if (foot.squared_distance <= kOnSurface * area_) return foot;
  return tree_.closest(x, foot.face);
}

Foot MeshSurface::near(const Vector3d& x, Index place) const {
  Foot best = tree_.on_face(x, place);
  for (int k = 0; k < kMostFaces && best.squared_distance > 0.0; ++k) {
    int corner;
    if (best.weights.minCoeff() > 0.0) break;  // closest inside the face
    best.weights.maxCoeff(&corner);
    Foot next = best;
    for (const Index at : corners_[tree_.faces()(best.face, corner)]) {
      const Foot foot = tree_.on_face(x, at / 3);
      if (foot.squared_distance < next.squared_distance) next = foot;
    }
    if (next.face == best.face) break;
    best = next;
  }
  return best;
}

Vector3d MeshSurface::interpolated(const Foot& foot) const {
  Vector3d normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    normal += foot.weights[k] * normals_.row(tree_.faces()(foot.face, k)).transpose();
  return normal;
}

Vector3d MeshSurface::outward_at(const Foot& foot) const {
  const Vector3d normal = interpolated(foot);
  const double length = normal.norm();
  return length > kOpposed ? normal / length : Vector3d(face_normals_.row(foot.face).transpose());
}

Matrix3d MeshSurface::frame_at(const Foot& foot) const {
  if (axes_ == MeshAxes::kSmooth) return axes_of(outward_at(foot));
  return axes_of(face_normals_.row(foot.face).transpose());
}

Matrix3d MeshSurface::derivative_at(const Foot& foot) const {
  const Vector3d normal = interpolated(foot);
  const double length = normal.norm();
  if (!(length > kOpposed)) return Matrix3d::Zero();
  const Vector3d n = normal / length, m = face_normals_.row(foot.face).transpose();
  const auto corner = [&](int k) -> Vector3d {
    return tree_.points().row(tree_.faces()(foot.face, k % 3)).transpose();
  };
  // Of the barycentric coordinate of corner k: across the opposite side, over twice the area.
  const double double_area = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  Matrix3d turn = Matrix3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vector3d slope = m.cross(corner(k + 2) - corner(k + 1)) / double_area;
    turn += normals_.row(tree_.faces()(foot.face, k)).transpose() * slope.transpose();
  }
  return (Matrix3d::Identity() - n * n.transpose()) / length * turn;
}

Vector3d MeshSurface::outward(const Vector3d& x, Index place) const {
  return outward_at(near(x, place));
}

Matrix3d MeshSurface::frame(const Vector3d& x, Index place) const {
  return frame_at(near(x, place));
}

Matrix3d MeshSurface::outward_derivative(const Vector3d& x, Index place) const {
  return derivative_at(near(x, place));
}

GlideSite MeshSurface::site(const Vector3d& x, Index hint, bool derivatives) const {
  const Foot foot = located(x, hint);
  GlideSite site;
  site.place = foot.face;
  site.outward = outward_at(foot);
  if (!derivatives) return site;
  site.frame = frame_at(foot);
  site.turn = derivative_at(foot);
  return site;
}

Vector3d MeshSurface::moved(const Vector3d& x, Index place, const Vector2d& step) const {
  return near(x + frame(x, place).leftCols<2>() * step, place).point;
}

Matrix2d MeshSurface::bending(const Vector3d&, const GlideSite& site, const Vector3d& g) const {
  const Eigen::Matrix<double, 3, 2> axes = site.frame.leftCols<2>();
  const Matrix2d shape = axes.transpose() * site.turn * axes;
  return -0.5 * g[2] * (shape + shape.transpose());
}

}  // namespace stretchmap::volume
