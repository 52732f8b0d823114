// A triangle mesh to glide on, against the torus it is inscribed in and against differences.
#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <memory>

#include "stretchmap/volume/boundary_barrier.hpp"
#include "stretchmap/volume/mesh_surface.hpp"
#include "support/differences.hpp"

TEST_SUITE_BEGIN("volume");

namespace {

using namespace stretchmap;
using Eigen::Vector3d;
using volume::MeshAxes;
using volume::MeshSurface;
using volume::TorusSurface;

constexpr double kR = 2.0, kr = 0.7;

Vector3d on_torus(double u, double v) { return Torus{kR, kr}.point(u, v); }

// `count` points round the tube, twice as many round the axis.
MeshSurface torus_mesh(Index count, MeshAxes axes = MeshAxes::kSmooth) {
  const Index around = 2 * count;
  Points points(around * count, 3);
  Faces faces(2 * around * count, 3);
  for (Index i = 0; i < around; ++i)
    for (Index j = 0; j < count; ++j) {
      const Index k = i * count + j, right = (i + 1) % around * count + j,
                  up = i * count + (j + 1) % count,
                  far = (i + 1) % around * count + (j + 1) % count;
      points.row(k) = on_torus(kTwoPi * i / around, kTwoPi * j / count).transpose();
      faces.row(2 * k) << k, right, far;
      faces.row(2 * k + 1) << k, far, up;
    }
  return MeshSurface(points, faces, axes);
}

// The point of the mesh closest to one of the torus.
Vector3d onto(const MeshSurface& mesh, const Vector3d& x) {
  return mesh.moved(x, mesh.place(x), Eigen::Vector2d::Zero());
}

// A square plate of small thickness, two triangles on either side.
MeshSurface plate(double thickness) {
  Points points(8, 3);
  for (Index k = 0; k < 8; ++k)
    points.row(k) << double(k & 1), double((k >> 1) & 1), thickness * (k >> 2);
  Faces faces(12, 3);
  faces << 0, 3, 1, 0, 2, 3, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 7, 3, 2, 6, 7, 0, 6, 2, 0, 4, 6,
      1, 3, 7, 1, 7, 5;
  return MeshSurface(points, faces);
}

}  // namespace

TEST_CASE("frames, areas and bending of a mesh approach those of the torus it is inscribed in") {
  const TorusSurface torus(kR, kr);
  double normals[2], areas[2], bends[2];
  for (int level = 0; level < 2; ++level) {
    const MeshSurface mesh = torus_mesh(level == 0 ? 24 : 48);
    normals[level] = bends[level] = 0.0;
    areas[level] = std::abs(mesh.area() - torus.area());
    for (int k = 0; k < 40; ++k) {
      const Vector3d x = on_torus(0.37 * k, 0.91 * k), y = onto(mesh, x);
      const Index place = mesh.place(y);
      const Eigen::Matrix3d frame = mesh.frame(y, place);
      CHECK((frame.transpose() * frame - Eigen::Matrix3d::Identity()).norm() < 1e-12);
      CHECK(frame.determinant() == doctest::Approx(1.0));
      normals[level] = std::max(normals[level], (frame.col(2) - torus.outward(x, -1)).norm());
      const Vector3d g(0.0, 0.0, 1.0);
      const auto curvatures = [](const Eigen::Matrix2d& C) {
        return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(C).eigenvalues().eval();
      };
      bends[level] += (curvatures(mesh.bending(y, mesh.site(y, -1, true), g)) -
                       curvatures(torus.bending(x, torus.site(x, -1, true), g)))
                          .norm();
    }
  }
  CHECK(areas[1] < 0.3 * areas[0]);
  CHECK(normals[1] < 0.4 * normals[0]);
  CHECK(bends[1] < 0.7 * bends[0]);
}

TEST_CASE("a step along a mesh stays on it and goes where it goes on the torus") {
  const MeshSurface mesh = torus_mesh(48);
  for (int k = 0; k < 20; ++k) {
    const Vector3d x = onto(mesh, on_torus(0.53 * k, 1.7 * k));
    const Index place = mesh.place(x);
    const Eigen::Vector2d step(0.2 * std::cos(k), 0.2 * std::sin(k));
    const Vector3d y = mesh.moved(x, place, step);
    CHECK((onto(mesh, y) - y).norm() < 1e-12);
    CHECK((y - x).norm() == doctest::Approx(0.2).epsilon(0.05));
    CHECK((y - x).normalized().dot(mesh.frame(x, place).leftCols<2>() * step) > 0.19);
  }
}

TEST_CASE("a step begins along axes in the face, and off smooth ones by as much as these slope") {
  const MeshSurface smooth = torus_mesh(16), flat = torus_mesh(16, MeshAxes::kFace);
  double off = 0.0;
  for (int k = 0; k < 20; ++k) {
    const Vector3d x = onto(flat, on_torus(0.4 * k + 0.05, 0.9 * k + 0.03));
    const Index place = flat.place(x);
    CHECK(flat.outward(x, place) == smooth.outward(x, place));
    const double slope = smooth.frame(x, place).col(2).cross(flat.frame(x, place).col(2)).norm();
    for (int c = 0; c < 2; ++c) {
      const auto begin = [&](const MeshSurface& mesh) -> Vector3d {
        return tests::slope(
            [&](double t) { return mesh.moved(x, place, t * Eigen::Vector2d::Unit(c)); }, 1e-6);
      };
      CHECK(tests::relative_error(begin(flat), flat.frame(x, place).col(c)) < 1e-8);
      const double error = (begin(smooth) - smooth.frame(x, place).col(c)).norm();
      CHECK(error <= 1.001 * slope + 1e-8);
      off = std::max(off, error);
    }
  }
  CHECK(off > 0.01);
}

TEST_CASE("the outward direction of a mesh turns as its derivative says") {
  const MeshSurface mesh = torus_mesh(16);
  for (int k = 0; k < 20; ++k) {
    const Vector3d x = onto(mesh, on_torus(0.4 * k + 0.05, 0.9 * k + 0.03));
    const Index place = mesh.place(x);
    Eigen::Matrix3d numeric;
    for (int c = 0; c < 3; ++c)
      numeric.col(c) = tests::slope(
          [&](double t) {
            const Vector3d moved = x + t * Vector3d::Unit(c);
            return mesh.outward(moved, mesh.place(moved));
          },
          1e-6);
    CHECK(tests::relative_error(numeric, mesh.outward_derivative(x, place)) < 1e-6);
  }
}

TEST_CASE("the gradient of a face that glides on a mesh matches differences") {
  const auto mesh = std::make_shared<const MeshSurface>(torus_mesh(16));
  const IndexVec number = IndexVec::LinSpaced(3, 0, 2);
  Points source(3, 3), x(3, 3);
  source << 0.0, 0.0, 0.0, 0.5, 0.1, 0.0, 0.1, 0.4, 0.2;
  x.row(0) = onto(*mesh, on_torus(0.31, 0.42)).transpose();
  x.row(1) = onto(*mesh, on_torus(0.57, 0.53)).transpose();
  Faces faces(1, 3);
  faces << 0, 1, 2;
  const Rows rest = volume::rest_triangles(source, faces, 1.1, 1e6);
  const volume::BoundaryBarrier barrier({mesh, faces, rest, Vec::Ones(1)});
  for (const bool folded : {false, true}) {
    x.row(2) = onto(*mesh, folded ? on_torus(0.45, 0.36) : on_torus(0.41, 0.83)).transpose();
    for (const double epsilon : {0.0, 0.4}) {
      if (folded && epsilon == 0.0) continue;
      const volume::GlideSites sites = sites_at(*mesh, x, {0, 1, 2}, number, true);
      Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero(), numeric;
      Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();
      barrier.model(x, sites, 0, epsilon, gradient, &hessian);
      for (int k = 0; k < 6; ++k)
        numeric[k] = tests::slope(
            [&](double t) {
              Points moved = x;
              moved.row(k / 2) += t * sites(k / 2).frame.col(k % 2).transpose();
              const auto there = sites_at(*mesh, moved, {0, 1, 2}, number, false);
              return barrier.value(moved, there, 0, epsilon).energy;
            },
            1e-6);
      CHECK(tests::relative_error(numeric, gradient) < 1e-6);
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(hessian);
      CHECK(eigen.eigenvalues()[0] > -1e-10 * hessian.cwiseAbs().maxCoeff());
      CHECK((barrier.value(x, sites, 0, 1.0).facing < 0.0) == folded);
    }
  }
}

TEST_CASE("a point does not change to another sheet, however near that is") {
  const double thin = 1e-3;
  const MeshSurface mesh = plate(thin);
  const Vector3d below(0.5, 0.4, 0.0);
  const Index place = mesh.place(below);
  const Vector3d inside(0.5, 0.4, 0.9 * thin);  // nearer to the upper side
  CHECK(mesh.outward(inside, place)[2] < 0.0);
  CHECK(mesh.outward(inside, mesh.place(inside))[2] > 0.0);
  const Vector3d moved = mesh.moved(below, place, Eigen::Vector2d(0.05, 0.05));
  CHECK(moved[2] == doctest::Approx(0.0));
}

TEST_CASE("a hint spares the search, and a wrong one does not mislead") {
  const MeshSurface mesh = torus_mesh(16);
  for (int k = 0; k < 20; ++k) {
    const Vector3d x = onto(mesh, on_torus(0.4 * k + 0.05, 0.9 * k + 0.03));
    const Vector3d y = mesh.moved(x, mesh.place(x), Eigen::Vector2d(0.1, -0.2));
    const Index there = mesh.place(y);
    CHECK(mesh.place(y, there) == there);
    CHECK(mesh.place(y, mesh.place(x)) == there);
    const Vector3d across = onto(mesh, on_torus(0.4 * k + 3.0, 0.9 * k + 2.0));
    CHECK(mesh.place(y, mesh.place(across)) == there);
    const volume::GlideSite site = mesh.site(y, mesh.place(x), true);
    CHECK(site.place == there);
    CHECK(site.outward == mesh.outward(y, there));
    CHECK(site.frame == mesh.frame(y, there));
    CHECK(site.turn == mesh.outward_derivative(y, there));
  }
  const MeshSurface thin = plate(1e-3);
  const Vector3d below(0.5, 0.4, 0.0), above(0.5, 0.4, 1e-3);
  CHECK(thin.place(above, thin.place(below)) == thin.place(above));
}

TEST_SUITE_END();
