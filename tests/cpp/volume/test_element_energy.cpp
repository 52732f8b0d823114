// The energy of one tet against differences, closed forms and an eigenvalue decomposition.
#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <random>

#include "stretchmap/volume/element_energy.hpp"
#include "support/differences.hpp"

TEST_SUITE_BEGIN("volume");

namespace {

using namespace stretchmap;
using Eigen::Matrix3d;
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using volume::ElementBatch;
using volume::EnergyWeights;
using volume::kLanes;

struct Element {
  double energy;
  Matrix3d gradient;  // by the entries of J
  Matrix9d hessian;   // by vec(J)
};

// psi(J) with the derivatives that the kernel gives for the rest shape of the unit tet.
Element evaluate(const Matrix3d& J, const EnergyWeights& weights, double own = 0.0) {
  ElementBatch batch;
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int k = 0; k < 9; ++k) {
      batch.edges[k][lane] = J.data()[k];
      batch.rest[k][lane] = k % 4 == 0 ? 1.0 : 0.0;
    }
    batch.weight[lane] = 1.0;
    batch.own[lane] = own;
  }
  volume::element_models(batch, weights);
  Element out;
  out.energy = batch.energy[0];
  for (int k = 0; k < 9; ++k) out.gradient.data()[k] = batch.gradient[k][0];
  int at = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = a; b < 3; ++b, ++at)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          out.hessian(3 * a + i, 3 * b + j) = out.hessian(3 * b + j, 3 * a + i) =
              batch.block[at][3 * i + j][0];
  return out;
}

Matrix3d unit(int k) {
  Matrix3d E = Matrix3d::Zero();
  E.data()[k] = 1.0;
  return E;
}

Matrix9d hessian_by_differences(const Matrix3d& J, const EnergyWeights& weights) {
  Matrix9d H;
  for (int k = 0; k < 9; ++k) {
    const Matrix3d column =
        tests::slope([&](double t) { return evaluate(J + t * unit(k), weights).gradient; }, 1e-5);
    H.col(k) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(column.data());
  }
  return 0.5 * (H + H.transpose());
}

// With the negative eigenvalues multiplied by a factor.
Matrix9d damped(const Matrix9d& H, double factor) {
  const Eigen::SelfAdjointEigenSolver<Matrix9d> eigen(H);
  const auto values = eigen.eigenvalues().unaryExpr(
      [&](double value) { return value < 0.0 ? factor * value : value; });
  return eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
}

// Random Jacobians near `center`, inverted or not as asked.
class Jacobians {
 public:
  explicit Jacobians(unsigned seed) : engine_(seed) {}
  Matrix3d next(const Matrix3d& center, double spread, bool inverted) {
    std::normal_distribution<double> normal;
    Matrix3d J = center;
    for (int k = 0; k < 9; ++k) J.data()[k] += spread * normal(engine_);
    if ((J.determinant() < 0.0) != inverted) J.col(0) *= -1.0;
    return J;
  }

 private:
  std::mt19937 engine_;
};

}  // namespace

TEST_CASE("the gradient of a tet's energy matches differences") {
  Jacobians random(7);
  for (const double epsilon : {0.0, 0.3, 2.0}) {
    for (const bool inverted : {false, true}) {
      if (inverted && epsilon == 0.0) continue;
      const EnergyWeights weights{1.3, 0.7, epsilon};
      for (int trial = 0; trial < 10; ++trial) {
        const Matrix3d J = random.next(Matrix3d::Identity(), 0.3, inverted);
        const Matrix3d P = evaluate(J, weights).gradient;
        Matrix3d numeric;
        for (int k = 0; k < 9; ++k)
          numeric.data()[k] = tests::slope(
              [&](double t) { return evaluate(J + t * unit(k), weights).energy; }, 1e-6);
        CHECK(tests::relative_error(numeric, P) < 3e-6);
      }
    }
  }
}

TEST_CASE("the Hessian of a tet's energy is the differenced one, negative eigenvalues damped") {
  Jacobians random(8);
  for (const double epsilon : {0.0, 0.3}) {
    EnergyWeights weights{1.0, 2.0, epsilon};
    for (int trial = 0; trial < 20; ++trial) {
      weights.negative = trial % 4 < 2 ? 0.0 : 0.5;
      const bool inverted = epsilon > 0.0 && trial % 2 == 0;
      const Matrix3d J =
          random.next(Eigen::Vector3d(1.0, 0.9, 0.7).asDiagonal().toDenseMatrix(), 0.25, inverted);
      const Matrix9d exact = hessian_by_differences(J, weights);
      const Matrix9d error = evaluate(J, weights).hessian - damped(exact, weights.negative);
      CHECK(error.cwiseAbs().maxCoeff() < 1e-5 * exact.cwiseAbs().maxCoeff());
    }
  }
}

TEST_CASE("an epsilon of a tet's own adds to the square of that of all, but is none without it") {
  Jacobians random(10);
  for (int trial = 0; trial < 10; ++trial) {
    const Matrix3d J = random.next(Matrix3d::Identity(), 0.3, trial % 2 == 0);
    const Element own = evaluate(J, {1.0, 2.0, 0.3}, 0.16), same = evaluate(J, {1.0, 2.0, 0.5});
    CHECK(own.energy == doctest::Approx(same.energy).epsilon(1e-12));
    CHECK(tests::relative_error(own.gradient, same.gradient) < 1e-12);
    CHECK((own.hessian - same.hessian).cwiseAbs().maxCoeff() <
          1e-12 * same.hessian.cwiseAbs().maxCoeff());
    if (trial % 2 == 1) CHECK(evaluate(J, {}, 0.16).energy == evaluate(J, {}).energy);
  }
}

TEST_CASE("rotations cost nothing and are minima") {
  Jacobians random(9);
  Matrix3d Q = random.next(Matrix3d::Zero(), 1.0, false).householderQr().householderQ();
  if (Q.determinant() < 0.0) Q.col(0) *= -1.0;
  const Element at = evaluate(Q, {1.0, 5.0});
  CHECK(std::abs(at.energy) < 1e-14);
  CHECK(at.gradient.cwiseAbs().maxCoeff() < 1e-13);
}

TEST_CASE("the two terms have their closed forms") {
  for (const double d : {0.25, 1.0, 3.0}) {
    const Matrix3d J = Eigen::Vector3d(1.0, 1.0, d).asDiagonal();
    CHECK(evaluate(J, {0.0, 1.0}).energy ==
          doctest::Approx(0.5 * (d + 1.0 / d) - 1.0).epsilon(1e-14));
  }
  // tr / (3 det^(2/3)) - 1
  const Matrix3d J = Eigen::Vector3d(1.0, 2.0, 4.0).asDiagonal();
  CHECK(evaluate(J, {1.0, 0.0}).energy == doctest::Approx(21.0 / 12.0 - 1.0).epsilon(1e-14));
}

TEST_CASE("an inverted tet is infinitely bad without regularization") {
  const Matrix3d J = Eigen::Vector3d(1.0, 1.0, -0.1).asDiagonal();
  ElementBatch batch;
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int k = 0; k < 9; ++k) {
      batch.edges[k][lane] = J.data()[k];
      batch.rest[k][lane] = k % 4 == 0 ? 1.0 : 0.0;
    }
    batch.weight[lane] = 1.0;
  }
  volume::element_values(batch, {1.0, 1.0});
  CHECK(batch.energy[0] == std::numeric_limits<double>::infinity());
  CHECK(batch.det[0] == doctest::Approx(-0.1));
}

TEST_CASE("degenerate tets are finite when regularized") {
  for (int rank = 0; rank < 3; ++rank) {
    Matrix3d J = Matrix3d::Zero();
    J.topLeftCorner(rank, rank).setIdentity();
    const Element at = evaluate(J, {1.0, 1.0, 0.5});
    CHECK(std::isfinite(at.energy));
    CHECK(at.gradient.allFinite());
    REQUIRE(at.hessian.allFinite());
    const double least = Eigen::SelfAdjointEigenSolver<Matrix9d>(at.hessian).eigenvalues()[0];
    CHECK(least > -1e-9 * at.hessian.cwiseAbs().maxCoeff());
  }
}

TEST_SUITE_END();
