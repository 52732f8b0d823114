// The Hessians of faces without their negative parts, against the eigenvalues of dense matrices.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>

#include "area/convex_faces.hpp"
#include "stretchmap/linalg/symmetric.hpp"

TEST_SUITE_BEGIN("area");

namespace {

using namespace stretchmap;
using SixSix = Eigen::Matrix<double, 6, 6>;

constexpr Index kFaces = 29;

// Symmetric, and with positive eigenvalues alone in every third row.
Rows some_hessians() {
  std::mt19937 engine(5);
  std::normal_distribution<double> normal;
  Rows hessians(kFaces, 36);
  for (Index f = 0; f < kFaces; ++f) {
    SixSix any, matrix;
    for (double& entry : any.reshaped()) entry = normal(engine);
    if (f % 3 == 0)
      matrix = any * any.transpose() + 0.1 * SixSix::Identity();
    else
      matrix = any + any.transpose();
    Eigen::Map<SixSix>(hessians.row(f).data()) = matrix;
  }
  return hessians;
}

TEST_CASE("negative eigenvalues are taken away, and nothing else") {
  const Rows before = some_hessians();
  Rows after = before;
  area::make_convex(after, 0, kFaces);
  for (Index f = 0; f < kFaces; ++f) {
    const Eigen::Map<const SixSix> given(before.row(f).data()), found(after.row(f).data());
    const Eigen::MatrixXd expected =
        linalg::map_eigenvalues(given, [](double value, double) { return std::max(value, 0.0); });
    CHECK((found - expected).cwiseAbs().maxCoeff() < 1e-11);
    CHECK((f % 3 != 0 || found == given));
  }
}

TEST_CASE("a matrix comes out the same whichever others are with it") {
  Rows together = some_hessians(), alone = together;
  area::make_convex(together, 0, kFaces);
  for (Index f = 0; f < kFaces; ++f) area::make_convex(alone, f, f + 1);
  CHECK(together == alone);
}

}  // namespace

TEST_SUITE_END();
