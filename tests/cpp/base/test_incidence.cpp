// What meets each of n things, listed in parts that threads share.
#include <doctest/doctest.h>

#include <random>
#include <vector>

#include "stretchmap/base/incidence.hpp"

TEST_SUITE_BEGIN("base");

using namespace stretchmap;

TEST_CASE("corners at a vertex ascend, and all of them are there, however many parts there are") {
  std::mt19937 engine(3);
  for (const Index m : {0, 5, 20000, 200000}) {
    const Index n = 1 + m / 6;
    Tets tets(m, 4);
    for (Index k = 0; k < tets.size(); ++k) tets.data()[k] = static_cast<Index>(engine() % n);
    // Vertex 0 is in no list.
    const Incidence<> corners = corners_at(tets, n, [](Index v) { return v == 0 ? -1 : v; });
    std::vector<std::vector<Index>> expected(static_cast<std::size_t>(n));
    for (Index c = 0; c < tets.size(); ++c)
      if (tets.data()[c] != 0) expected[tets.data()[c]].push_back(c);
    REQUIRE(corners.size() == n);
    for (Index v = 0; v < n; ++v)
      REQUIRE(std::vector<Index>(corners[v].begin(), corners[v].end()) == expected[v]);
  }
}

TEST_SUITE_END();
