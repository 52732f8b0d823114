// The energy of a boundary triangle that glides on a torus.
#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <memory>

#include "stretchmap/volume/boundary_barrier.hpp"
#include "support/differences.hpp"

TEST_SUITE_BEGIN("volume");

namespace {

using namespace stretchmap;
using volume::BoundaryBarrier;

constexpr double kR = 2.0, kr = 0.7;

struct Face {
  Points2 angles;  // (3, 2) of its corners
  BoundaryBarrier barrier;
};

Points on_torus(const Points2& angles) {
  Points x(3, 3);
  for (int k = 0; k < 3; ++k) {
    const double u = angles(k, 0), v = angles(k, 1), rho = kR + kr * std::cos(v);
    x.row(k) << rho * std::cos(u), rho * std::sin(u), kr * std::sin(v);
  }
  return x;
}

Face face_case(bool folded) {
  Points2 angles(3, 2);
  angles << 0.3, 0.4, 0.55, 0.5, 0.4, 0.8;
  if (folded) angles.row(2) << 0.45, 0.35;
  Points source(3, 3);
  source << 0.0, 0.0, 0.0, 0.5, 0.1, 0.0, 0.1, 0.4, 0.2;
  Faces faces(1, 3);
  faces << 0, 1, 2;
  const Rows rest = volume::rest_triangles(source, faces, 1.1, 1e6);
  const auto torus = std::make_shared<const volume::TorusSurface>(kR, kr);
  return {angles, BoundaryBarrier({torus, faces, rest, Vec::Ones(1)})};
}

// Energy, and where asked its derivatives, with what the surface has at the corners.
volume::FaceReport value(const BoundaryBarrier& barrier, const Points& x, double epsilon) {
  const IndexVec number = IndexVec::LinSpaced(3, 0, 2);
  return barrier.value(x, sites_at(barrier.surface(), x, {0, 1, 2}, number, false), 0, epsilon);
}

void model(const BoundaryBarrier& barrier, const Points& x, double epsilon,
           Eigen::Matrix<double, 6, 1>& gradient, Eigen::Matrix<double, 6, 6>& hessian) {
  const IndexVec number = IndexVec::LinSpaced(3, 0, 2);
  gradient.setZero();
  hessian.setZero();
  barrier.model(x, sites_at(barrier.surface(), x, {0, 1, 2}, number, true), 0, epsilon, gradient,
                &hessian);
}

}  // namespace

TEST_CASE("the gradient of a gliding face is by arc length along the coordinate circles") {
  for (const bool folded : {false, true}) {
    for (const double epsilon : {0.0, 0.4}) {
      if (folded && epsilon == 0.0) continue;
      const Face face = face_case(folded);
      Eigen::Matrix<double, 6, 1> gradient, numeric;
      Eigen::Matrix<double, 6, 6> hessian;
      model(face.barrier, on_torus(face.angles), epsilon, gradient, hessian);
      for (int k = 0; k < 6; ++k) {
        const double metric = k % 2 == 0 ? kR + kr * std::cos(face.angles(k / 2, 1)) : kr;
        numeric[k] = tests::slope(
            [&](double t) {
              Points2 moved = face.angles;
              moved(k / 2, k % 2) += t / metric;
              return value(face.barrier, on_torus(moved), epsilon).energy;
            },
            1e-6);
      }
      CHECK(tests::relative_error(numeric, gradient) < 1e-6);
      const auto values = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(hessian);
      CHECK(values.eigenvalues()[0] > -1e-10 * hessian.cwiseAbs().maxCoeff());
    }
  }
}

TEST_CASE("a folded face is infinitely bad without regularization") {
  const Face face = face_case(true);
  const volume::FaceReport report = value(face.barrier, on_torus(face.angles), 0.0);
  CHECK(report.energy == std::numeric_limits<double>::infinity());
  CHECK(report.facing <= 0.0);
}

TEST_SUITE_END();
