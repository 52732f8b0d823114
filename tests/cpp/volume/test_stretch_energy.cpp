// The volumetric stretch energy (5.1) and its gradient.
#include <doctest/doctest.h>

#include "stretchmap/mesh/size.hpp"
#include "stretchmap/volume/tet_laplacian.hpp"
#include "support/differences.hpp"
#include "support/shapes.hpp"

TEST_SUITE_BEGIN("volume");

using namespace stretchmap;
using doctest::Approx;

TEST_CASE("the gradient of the stretch energy matches differences") {
  const tests::Solid solid = tests::solid_torus(600);
  const Index n = static_cast<Index>(solid.points.rows());
  const Vec rest = mesh::tet_volumes(solid.source, solid.tets);
  const Points direction = tests::random_points(n, 1);
  const auto energy = [&](double t) {
    const Points x = solid.points + t * direction;
    return volume::tet_stretch_energy(mesh::tet_volumes(x, solid.tets), rest);
  };
  const Points gradient = volume::tet_stretch_gradient(solid.points, solid.tets, rest);
  CHECK((gradient.array() * direction.array()).sum() ==
        Approx(tests::slope(energy, 1e-6)).epsilon(1e-7));
  // Homogeneous of degree six in the image.
  CHECK((gradient.array() * solid.points.array()).sum() ==
        Approx(6.0 * energy(0.0)).epsilon(1e-12));
}

TEST_CASE("the stretch energy is least where volumes are preserved") {
  const tests::Solid solid = tests::solid_torus(600);
  const Vec rest = mesh::tet_volumes(solid.points, solid.tets);
  const double bound = 1.5 * rest.sum();
  CHECK(volume::tet_stretch_energy(rest, rest) == Approx(bound).epsilon(1e-14));
  Vec uneven = rest;
  uneven[0] += 0.5 * rest[1];
  uneven[1] -= 0.5 * rest[1];
  CHECK(volume::tet_stretch_energy(uneven, rest) > bound);
}

TEST_SUITE_END();
