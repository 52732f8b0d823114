// The dense part of a factorization, column by column as its definition has it.
#include <doctest/doctest.h>

#include "linalg/direct/dense_front.hpp"
#include "support/shapes.hpp"

TEST_SUITE_BEGIN("linalg");

using namespace stretchmap;

TEST_CASE("fronts that fill tiles, and fronts that do not, are eliminated") {
  for (const auto& [rows, own] :
       {std::pair<Index, Index>{1, 1}, {7, 3}, {16, 12}, {61, 37}, {300, 290}, {331, 40}}) {
    CAPTURE(rows);
    CAPTURE(own);
    const Points drawn = tests::random_points(rows * rows, 3);
    Eigen::MatrixXd matrix = Eigen::Map<const Eigen::MatrixXd>(drawn.data(), rows, rows);
    matrix = (matrix + matrix.transpose()).eval();
    matrix.diagonal().array() += 8.0 * rows;
    Eigen::MatrixXd panel = matrix.leftCols(own);
    Eigen::MatrixXd schur = matrix.bottomRightCorner(rows - own, rows - own);
    CHECK(linalg::eliminate_front(panel.data(), schur.data(), rows, own) == -1);
    for (Index c = 0; c < own; ++c) {
      const Eigen::VectorXd column = matrix.col(c).tail(rows - c - 1) / matrix(c, c);
      CHECK(panel(c, c) == doctest::Approx(matrix(c, c)));
      CHECK((panel.col(c).tail(rows - c - 1) - column).norm() < 1e-12);
      matrix.bottomRightCorner(rows - c - 1, rows - c - 1) -=
          matrix(c, c) * column * column.transpose();
    }
    const Eigen::MatrixXd rest = matrix.bottomRightCorner(rows - own, rows - own) - schur;
    CHECK(Eigen::MatrixXd(rest.triangularView<Eigen::Lower>()).norm() < 1e-9);
  }
}

TEST_CASE("an elimination's work is that of its steps") {
  double sum = 0.0;
  for (Index k = 0; k < 4; ++k) sum += (10.0 - k - 1.0) * (10.0 - k);
  CHECK(linalg::front_flops(10.0, 4.0) == doctest::Approx(sum));
  CHECK(linalg::front_flops(0.0, 0.0) == 0.0);
}

TEST_SUITE_END();
