// The assembled energy of a solid: derivatives, and faces whose vertices do not move.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "stretchmap/base/torus.hpp"
#include "stretchmap/mesh/size.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"
#include "stretchmap/volume/rest_shape.hpp"
#include "stretchmap/volume/solid_energy.hpp"
#include "support/differences.hpp"
#include "support/shapes.hpp"

TEST_SUITE_BEGIN("volume");

namespace {

using namespace stretchmap;
using volume::EnergyWeights;
using volume::GlidingBoundary;
using volume::SolidEnergy;

GlidingBoundary boundary_of(const tests::Solid& solid) {
  const Index n = static_cast<Index>(solid.points.rows());
  const mesh::TetBoundary boundary = mesh::tet_boundary(solid.tets, n);
  Faces faces = boundary.faces;
  for (Index i = 0; i < faces.size(); ++i) faces.data()[i] = boundary.vertices[faces.data()[i]];
  const Rows rest = volume::rest_triangles(solid.source, faces, 1.0, 1e6);
  const auto torus = std::make_shared<const volume::TorusSurface>(solid.R, solid.r);
  return {torus, faces, rest, Vec::Ones(faces.rows())};
}

SolidEnergy energy_of(const tests::Solid& solid, const Flags& motion,
                      GlidingBoundary boundary = {}) {
  const Rows rest = volume::rest_matrices(solid.source, solid.tets, 6.0);
  const Vec weights = Vec::Ones(solid.tets.rows());
  return SolidEnergy({solid.tets, rest, weights, motion}, solid.points, std::move(boundary));
}

// The standard solid with its interior vertices shaken.
Points shaken(const tests::Solid& solid, double size) {
  Points x = solid.points + size * tests::random_points(static_cast<Index>(solid.points.rows()), 4);
  for (Index i = 0; i < x.rows(); ++i)
    if (solid.boundary[i]) x.row(i) = solid.points.row(i);
  return x;
}

// Boundary vertices fixed, gliding, or by turns one and the other.
Flags motion_of(const tests::Solid& solid, int fixed_every) {
  Flags motion = Flags::Zero(solid.boundary.size());
  int seen = 0;
  for (Index i = 0; i < motion.size(); ++i)
    if (solid.boundary[i])
      motion[i] = fixed_every > 0 && seen++ % fixed_every == 0 ? volume::kFixed : volume::kGliding;
  return motion;
}

}  // namespace

TEST_CASE("faces whose vertices are fixed change no derivative") {
  const tests::Solid solid = tests::solid_torus(600);
  const Flags motion = motion_of(solid, 1);
  SolidEnergy with = energy_of(solid, motion, boundary_of(solid));
  SolidEnergy without = energy_of(solid, motion);
  const Points x = shaken(solid, 1e-2);
  Points gradient, same;
  linalg::BlockMatrix hessian = with.pattern(), model = without.pattern();
  const EnergyWeights weights{1.0, 1.0, 0.1, 0.5};
  with.model(x, weights, gradient, &hessian);
  without.model(x, weights, same, &model);
  CHECK((gradient.array() == same.array()).all());
  CHECK((hessian.values.array() == model.values.array()).all());
}

TEST_CASE("the gradient of a solid's energy matches differences") {
  const tests::Solid solid = tests::solid_torus(600);
  const Points x = shaken(solid, 1e-2);
  const EnergyWeights weights{1.0, 2.0, 0.2, 0.5};
  for (const int fixed_every : {0, 1, 3}) {
    SolidEnergy energy = energy_of(solid, motion_of(solid, fixed_every), boundary_of(solid));
    Points gradient;
    linalg::BlockMatrix hessian = energy.pattern();
    energy.model(x, weights, gradient, &hessian);
    REQUIRE(hessian.values.allFinite());
    Points step = tests::random_points(energy.rows(), 5);
    step.array() *= (gradient.array() != 0.0).cast<double>();  // no normals of gliding vertices
    const double slope = tests::slope(
        [&](double t) { return energy.value(energy.move(x, step, t), weights).energy; }, 1e-6);
    CHECK(slope == doctest::Approx((gradient.array() * step.array()).sum()).epsilon(1e-6));
  }
}

TEST_CASE("the Hessian is symmetric where a vertex has hundreds of neighbors") {
  const Index n = 400;  // round an edge: blocks far along its rows have to be searched
  Points points(n + 2, 3);
  points.row(0) << 0.0, 0.0, -1.0;
  points.row(1) << 0.0, 0.0, 1.0;
  Tets tets(n, 4);
  for (Index i = 0; i < n; ++i) {
    const double angle = kTwoPi * i / n;
    points.row(i + 2) << std::cos(angle), std::sin(angle), 0.01 * (i % 7);
    tets.row(i) << 0, i + 2, (i + 1) % n + 2, 1;
  }
  const Rows rest = volume::rest_matrices(points, tets, 1e3);
  const Vec weights = Vec::Ones(n);
  const Flags motion = Flags::Constant(n + 2, volume::kFree);
  SolidEnergy energy({tets, rest, weights, motion}, points);
  Points x = points + 1e-3 * tests::random_points(n + 2, 6), gradient;
  linalg::BlockMatrix hessian = energy.pattern();
  energy.model(x, EnergyWeights{1.0, 1.0, 0.0, 0.0}, gradient, &hessian);
  const auto block = [&](Index row, Index column) {
    const Index* first = hessian.col.data() + hessian.row_ptr[row];
    const Index* last = hessian.col.data() + hessian.row_ptr[row + 1];
    const Index* found = std::lower_bound(first, last, column);
    REQUIRE((found != last && *found == column));
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
        hessian.values.data() + 9 * (found - hessian.col.data()));
  };
  Index longest = 0;
  for (Index row = 0; row < hessian.rows(); ++row) {
    longest = std::max(longest, hessian.row_ptr[row + 1] - hessian.row_ptr[row]);
    for (Index e = hessian.row_ptr[row]; e < hessian.row_ptr[row + 1]; ++e) {
      const Index column = hessian.col[e];
      CHECK(block(row, column).norm() > 0.0);
      CHECK((block(row, column) - block(column, row).transpose()).norm() <=
            1e-9 * block(row, row).norm());
    }
  }
  CHECK(longest == n + 2);
}

TEST_CASE("a handful of elements that a whole step harms are named as they were given") {
  const tests::Solid solid = tests::solid_torus(600);
  const Points& x = solid.points;
  const SolidEnergy energy = energy_of(solid, motion_of(solid, 1));
  Points steps = Points::Zero(energy.rows(), 3);
  for (Index row = 0; row < energy.rows(); ++row) steps(row, 0) = row + 1.0;
  const Points numbered = energy.move(x, steps, 1.0) - x;
  const auto inverted = [&](const Points& at) {
    std::vector<Index> found;
    const Vec volumes = mesh::tet_volumes(at, solid.tets);
    for (Index t = 0; t < volumes.size(); ++t)
      if (!(volumes[t] > 0.0)) found.push_back(t);
    return found;
  };
  const EnergyWeights weights{1.0, 1.0, 0.0, 0.0};
  const double before = energy.value(x, weights).energy;
  int tried = 0;
  for (Index t = 0; t < solid.tets.rows() && tried < 20; ++t) {
    const Index tip = solid.tets(t, 0);
    if (solid.boundary[tip]) continue;
    ++tried;
    Points step = Points::Zero(energy.rows(), 3);  // the tip, through the face across
    const Eigen::RowVector3d across =
        (x.row(solid.tets(t, 1)) + x.row(solid.tets(t, 2)) + x.row(solid.tets(t, 3))) / 3.0;
    step.row(std::lround(numbered(tip, 0)) - 1) = 1.2 * (across - x.row(tip));
    const volume::EasedStep eased = energy.eased(x, step, weights, before, before);
    std::vector<Index> named = eased.held_up.tets;
    std::sort(named.begin(), named.end());
    const std::vector<Index> expected = inverted(energy.move(x, step, 1.0));
    CHECK(std::includes(named.begin(), named.end(), expected.begin(), expected.end()));
    CHECK(std::binary_search(named.begin(), named.end(), t));
    for (const Index other : named) CHECK((solid.tets.row(other).array() == tip).any());
  }
  REQUIRE(tried == 20);
  const Points all = 10.0 * tests::random_points(energy.rows(), 6);
  const volume::EasedStep eased = energy.eased(x, all, weights, 0.0, before);
  CHECK(eased.held_up.size() == 0);
  CHECK(std::isinf(eased.there.energy));
  CHECK(!energy.held_back(x, all).has_value());
}

TEST_SUITE_END();
