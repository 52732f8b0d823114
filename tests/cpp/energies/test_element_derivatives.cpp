// Energies of single elements: gradients and Hessians against differences of the values.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>

#include "stretchmap/energies/element_derivatives.hpp"
#include "stretchmap/volume/line_bound.hpp"
#include "stretchmap/volume/rest_shape.hpp"
#include "support/differences.hpp"

TEST_SUITE_BEGIN("energies");

namespace {

using namespace stretchmap;
using energies::ElementDerivatives;
using energies::Order;

Points unit_tet() {
  Points x(4, 3);
  x << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  return x;
}

Points shaken(const Points& x, double amount) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  return x + amount * Points::NullaryExpr(x.rows(), 3, [&] { return normal(random); });
}

// Both derivatives of one element along all its unknowns.
template <class Energy>
void check(const Energy& energy, const Points& x) {
  const ElementDerivatives found = energy(x, energies::kHessians);
  const Eigen::Index n = x.size();
  Vec gradient(n);
  Rows hessian(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto moved = [&](double h) {
      Points y = x;
      y.data()[k] += h;
      return y;
    };
    gradient[k] =
        tests::slope([&](double h) { return energy(moved(h), energies::kValues).values[0]; }, 1e-5);
    hessian.row(k) = tests::slope(
        [&](double h) { return Rows(energy(moved(h), energies::kGradients).gradients); }, 1e-5);
  }
  CHECK(tests::relative_error(Vec(found.gradients.row(0)), gradient) < 1e-7);
  CHECK(tests::relative_error(Rows(Eigen::Map<const Rows>(found.hessians.data(), n, n)), hessian) <
        1e-7);
}

}  // namespace

TEST_CASE("derivatives of the stretch energies") {
  Tets tet(1, 4);
  tet << 0, 1, 2, 3;
  check([&](const Points& x,
            Order order) { return energies::tet_stretch(x, tet, Vec::Constant(1, 0.3), order); },
        shaken(unit_tet(), 0.3));
  Faces face(1, 3);
  face << 0, 1, 2;
  check([&](const Points& x,
            Order order) { return energies::face_stretch(x, face, Vec::Constant(1, 0.7), order); },
        shaken(unit_tet().topRows(3), 0.3));
}

TEST_CASE("derivatives of the distortion energy, right way round and inverted") {
  Tets tet(1, 4);
  tet << 0, 1, 2, 3;
  const Rows rest = volume::rest_matrices(shaken(unit_tet(), 0.1), tet, 1e9);
  for (const double sign : {1.0, -1.0})
    check(
        [&](const Points& x, Order order) {
          return energies::tet_distortion(x, tet, rest, Vec::Constant(1, 2.0), {0.8, 1.7, 0.2, 0.0},
                                          order, false);
        },
        sign * shaken(unit_tet(), 0.2));
}

TEST_CASE("a tet that collapses along a line is stopped before it does, however long the line") {
  Tets tet(1, 4);
  tet << 0, 1, 2, 3;
  const Points x = unit_tet();
  for (const double limit : {1.0, 3.0, 1e6}) {
    Points step = Points::Zero(4, 3);
    step(3, 2) = -0.5;  // flat at 2
    const double alpha = volume::longest_steps(tet, x, step, limit)[0];
    CHECK(alpha <= 2.0);
    CHECK(alpha >= std::min(limit, 2.0 * (1.0 - 1e-3)));
  }
}

TEST_SUITE_END();
