// Neighbors of tets across faces.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>

#include "stretchmap/mesh/tet_boundary.hpp"
#include "support/shapes.hpp"

TEST_SUITE_BEGIN("mesh");

namespace {

using namespace stretchmap;

// The face opposite corner h % 4 of tet h / 4, vertices ascending.
std::array<Index, 3> face_of(const Tets& tets, Index h) {
  std::array<Index, 3> face{};
  int at = 0;
  for (int k = 0; k < 4; ++k)
    if (k != h % 4) face[at++] = tets(h / 4, k);
  std::sort(face.begin(), face.end());
  return face;
}

}  // namespace

TEST_CASE("neighboring tets name each other and share a face") {
  const tests::Solid solid = tests::solid_torus(600);
  const Index n = static_cast<Index>(solid.points.rows());
  const IndexVec twin = mesh::tet_neighbors(solid.tets, n);
  REQUIRE(twin.size() == 4 * solid.tets.rows());
  Index alone = 0;
  for (Index h = 0; h < twin.size(); ++h) {
    if (twin[h] < 0) {
      ++alone;
      continue;
    }
    CHECK(twin[twin[h]] == h);
    CHECK(face_of(solid.tets, h) == face_of(solid.tets, twin[h]));
  }
  CHECK(alone == mesh::tet_boundary(solid.tets, n).faces.rows());
}

TEST_SUITE_END();
