// The factorization of surface Newton systems against a general sparse one.
#include <doctest/doctest.h>

#include <Eigen/SparseLU>
#include <algorithm>
#include <random>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/threads.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"
#include "support/shapes.hpp"

TEST_SUITE_BEGIN("linalg");

namespace {

using namespace stretchmap;

// Full blocks on the pattern of a torus; the last unknown of each block a multiplier or not.
SparseMatrix block_system(int block, bool quasi_definite, int rings = 9, int sections = 7) {
  const Faces faces = tests::wavy_torus(rings, sections).topology.faces;
  const int size = 3 * block;
  std::mt19937 engine(6);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index f = 0; f < faces.rows(); ++f) {
    Eigen::MatrixXd half(size, size);
    for (Index k = 0; k < half.size(); ++k) half.data()[k] = normal(engine);
    const Eigen::MatrixXd part = half * half.transpose();
    for (int a = 0; a < size; ++a) {
      for (int b = 0; b < size; ++b) {
        const int multipliers =
            quasi_definite ? int(a % block == block - 1) + int(b % block == block - 1) : 0;
        const double factor = multipliers == 2 ? -1e-4 : multipliers == 1 ? 3.0 : 1.0;
        entries.emplace_back(block * faces(f, a / block) + a % block,
                             block * faces(f, b / block) + b % block, factor * part(a, b));
      }
    }
  }
  const Index n = block * (faces.maxCoeff() + 1);
  SparseMatrix matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

template <int K>
void check_against_lu(bool quasi_definite) {
  const SparseMatrix matrix = block_system(K, quasi_definite);
  const Points normal = tests::random_points(static_cast<Index>(matrix.rows()), 9);
  const Vec right = normal.col(0);
  linalg::BlockLdlt<K> factor(matrix);
  factor.factorize(matrix);
  Eigen::SparseLU<Eigen::SparseMatrix<double>> lu(matrix);
  const Vec expected = lu.solve(right);
  CHECK((factor.solve(right) - expected).cwiseAbs().maxCoeff() <
        1e-8 * expected.cwiseAbs().maxCoeff());
}

}  // namespace

TEST_CASE("blocks of up to three unknowns, definite and quasi-definite, are solved") {
  check_against_lu<1>(false);
  for (const bool quasi_definite : {false, true}) {
    check_against_lu<2>(quasi_definite);
    check_against_lu<3>(quasi_definite);
  }
}

TEST_CASE("the residual is small where separators and borders are many") {
  const SparseMatrix matrix = block_system(3, true, 90, 47);
  const Points normal = tests::random_points(static_cast<Index>(matrix.rows()), 4);
  linalg::BlockLdlt<3> factor(matrix);
  factor.factorize(matrix);
  const Vec right = normal.col(1), solution = factor.solve(right);
  CHECK((matrix * solution - right).norm() < 1e-9 * right.norm());
  factor.factorize(2.0 * matrix);
  CHECK((2.0 * factor.solve(right) - solution).norm() < 1e-12 * solution.norm());
}

TEST_CASE("factors and solutions have the same bits with any number of threads") {
  const SparseMatrix matrix = block_system(3, true, 90, 47);
  const Vec right = tests::random_points(static_cast<Index>(matrix.rows()), 4).col(2);
  const auto solved = [&](int threads) {
    const int before = thread_count();
    set_thread_count(threads);
    linalg::BlockLdlt<3> factor(matrix);
    factor.factorize(matrix);
    const Vec solution = factor.solve(right);
    set_thread_count(before);
    return solution;
  };
  const Vec one = solved(1);
  for (const int threads : {2, 3, 8}) CHECK((solved(threads).array() == one.array()).all());
}

TEST_CASE("graphs of very many components and of a few unequal ones are solved") {
  const SparseMatrix part = block_system(1, false);
  const Index n = static_cast<Index>(part.rows()), single = 100000;
  for (const Index before : {Index(0), Index(7), single}) {
    std::vector<Eigen::Triplet<double, Index>> entries;
    for (Index i = 0; i < single; ++i) {
      const Index row = i < before ? i : i + 2 * n;
      entries.emplace_back(row, row, 2.0 + i % 3);
    }
    for (Index copy = 0; copy < 2; ++copy)
      for (Index i = 0; i < n; ++i)
        for (SparseMatrix::InnerIterator entry(part, i); entry; ++entry)
          entries.emplace_back(before + copy * n + i, before + copy * n + entry.col(),
                               entry.value());
    SparseMatrix matrix(single + 2 * n, single + 2 * n);
    matrix.setFromTriplets(entries.begin(), entries.end());
    linalg::BlockLdlt<1> factor(matrix);
    factor.factorize(matrix);
    CHECK(factor.not_positive().empty());
    const Vec right = tests::random_points(static_cast<Index>(matrix.rows()), 2).col(0);
    CHECK((matrix * factor.solve(right) - right).norm() < 1e-10 * right.norm());
  }
}

TEST_CASE("rows of pivots that are not positive are named") {
  SparseMatrix matrix = block_system(1, false);
  linalg::BlockLdlt<1> factor(matrix);
  factor.factorize(matrix);
  CHECK(factor.not_positive().empty());
  matrix.coeffRef(5, 5) = -1.0;
  factor.factorize(matrix);
  const std::vector<Index> bad = factor.not_positive();
  CHECK(std::find(bad.begin(), bad.end(), 5) != bad.end());
}

TEST_CASE("a singular pivot is an error") {
  SparseMatrix matrix = block_system(2, false);
  matrix.coeffs().setZero();
  linalg::BlockLdlt<2> factor(matrix);
  CHECK_THROWS_AS(factor.factorize(matrix), Error);
}

TEST_SUITE_END();
