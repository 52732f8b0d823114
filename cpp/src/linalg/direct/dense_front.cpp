#include "linalg/direct/dense_front.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

#include "stretchmap/base/clones.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::linalg {

namespace {

constexpr Index kTall = 8, kWide = 6;  // tile of the product that stays in registers
constexpr Index kDeep = 256;           // columns of the factors taken at a time
constexpr Index kRows = 16 * kTall;    // rows of a block that stays in the second-level cache
constexpr Index kBlock = 32;           // columns of a panel eliminated one by one

Index tiles(Index n, Index size) { return (n + size - 1) / size; }

// target(i, j) -= sum over k of a[k][i] b[k][j], i < kTall, j < kWide; its columns `stride` apart.
// One text for several kinds of processors: of a function that is only inlined into those for one
// kind, GCC has by then split up the vectors that all others would have to.
#define STRETCHMAP_SUBTRACT_TILE(attributes, Vector)                                              \
  attributes void subtract_tile(const double* a, const double* b, Index depth, double* target,    \
                                std::ptrdiff_t stride) {                                          \
    constexpr Index kLanes = sizeof(Vector) / sizeof(double), kVectors = kTall / kLanes;          \
    const double zeros[kLanes] = {};                                                              \
    Vector sum[kWide][kVectors];                                                                  \
    for (Index j = 0; j < kWide; ++j)                                                             \
      for (Index v = 0; v < kVectors; ++v) std::memcpy(&sum[j][v], zeros, sizeof(Vector));        \
    for (Index k = 0; k < depth; ++k, a += kTall, b += kWide) {                                   \
      Vector left[kVectors];                                                                      \
      for (Index v = 0; v < kVectors; ++v) std::memcpy(&left[v], a + v * kLanes, sizeof(Vector)); \
      for (Index j = 0; j < kWide; ++j)                                                           \
        for (Index v = 0; v < kVectors; ++v) sum[j][v] += left[v] * b[j];                         \
    }                                                                                             \
    for (Index j = 0; j < kWide; ++j)                                                             \
      for (Index v = 0; v < kVectors; ++v) {                                                      \
        Vector part;                                                                              \
        std::memcpy(&part, target + j * stride + v * kLanes, sizeof(Vector));                     \
        part -= sum[j][v];                                                                        \
        std::memcpy(target + j * stride + v * kLanes, &part, sizeof(Vector));                     \
      }                                                                                           \
  }

#if defined(__GNUC__)
using Two = double __attribute__((vector_size(16)));
#else
using Two = Eigen::Array2d;
#endif

#ifdef STRETCHMAP_CLONES_CHOSEN
using Four = double __attribute__((vector_size(32)));
using Eight = double __attribute__((vector_size(64)));
STRETCHMAP_SUBTRACT_TILE(__attribute__((target("default"))), Two)
STRETCHMAP_SUBTRACT_TILE(__attribute__((target("arch=x86-64-v3"))), Four)
STRETCHMAP_SUBTRACT_TILE(__attribute__((target("arch=x86-64-v4"))), Eight)
#else
STRETCHMAP_SUBTRACT_TILE(, Two)
#endif

// The same of a part of a tile.
void subtract_part(const double* a, const double* b, Index depth, double* target,
                   std::ptrdiff_t stride, Index tall, Index wide) {
  double tile[kWide * kTall] = {};
  subtract_tile(a, b, depth, tile, kTall);
  for (Index j = 0; j < wide; ++j)
    for (Index i = 0; i < tall; ++i) target[j * stride + i] += tile[kTall * j + i];
}

// The columns right of `c` up to `end`, and the rows from there on up to `end`, less the outer
// product.
STRETCHMAP_CLONES void eliminate_column(double* panel, std::ptrdiff_t rows, Index c, Index end) {
  double* column = panel + c * rows;
  const double pivot = column[c];
  for (Index to = c + 1; to < end; ++to) {
    const double factor = column[to] / pivot;
    double* target = panel + to * rows;
    for (Index r = to; r < end; ++r) target[r] -= factor * column[r];
  }
  for (Index r = c + 1; r < end; ++r) column[r] /= pivot;
}

// The same of rows [top, bottom) below them, for all columns [begin, end) one after the other.
STRETCHMAP_CLONES void eliminate_rows(double* panel, std::ptrdiff_t rows, Index begin, Index end,
                                      std::ptrdiff_t top, std::ptrdiff_t bottom) {
  for (Index c = begin; c < end; ++c) {
    double* column = panel + c * rows;
    const double pivot = column[c];
    for (Index to = c + 1; to < end; ++to) {
      const double factor = column[to];
      double* target = panel + to * rows;
      for (std::ptrdiff_t r = top; r < bottom; ++r) target[r] -= factor * column[r];
    }
    for (std::ptrdiff_t r = top; r < bottom; ++r) column[r] /= pivot;
  }
}

// Rows [first, first + n) and columns [begin, end) of L, in strips of `size` rows, padded with
// zeros; times D if given.
void pack(const double* panel, std::ptrdiff_t rows, Index first, Index n, Index begin, Index end,
          Index size, const double* diagonal, double* out) {
  for (Index strip = 0; strip < n; strip += size) {
    const Index filled = std::min(size, n - strip);
    for (Index k = begin; k < end; ++k, out += size) {
      const double* from = panel + k * rows + first + strip;
      const double factor = diagonal ? diagonal[k] : 1.0;
      for (Index i = 0; i < filled; ++i) out[i] = factor * from[i];
      for (Index i = filled; i < size; ++i) out[i] = 0.0;
    }
  }
}

// The matrix an update is taken from; its entry (i, j) is at data[j * stride + i].
struct Target {
  double* data;
  std::ptrdiff_t stride;
  Index rows, columns;
};

// target -= L(rows from `first_row` on) D L(rows from `first_column` on)', columns [0, depth) of L;
// of tiles on or below the diagonal alone.
void update(const Target& target, const double* panel, std::ptrdiff_t rows, Index first_row,
            Index first_column, Index depth, const double* diagonal) {
  const Index strips = tiles(target.columns, kWide);
  std::vector<double> right(static_cast<std::size_t>(strips) * kWide * std::min(depth, kDeep));
  const Index blocks = tiles(target.rows, kRows);
  for (Index begin = 0; begin < depth; begin += kDeep) {
    const Index end = std::min(depth, begin + kDeep), deep = end - begin;
    pack(panel, rows, first_column, target.columns, begin, end, kWide, diagonal, right.data());
    for_rows(blocks, 1, [&](Index block) {
      const Index top = block * kRows, height = std::min(kRows, target.rows - top);
      thread_local std::vector<double> left;
      left.resize(static_cast<std::size_t>(kRows) * kDeep);
      pack(panel, rows, first_row + top, height, begin, end, kTall, nullptr, left.data());
      for (Index s = 0; s < strips && s * kWide < top + height; ++s)
        for (Index t = 0; t < height; t += kTall) {
          const Index row = top + t, column = s * kWide;
          if (row + kTall <= column) continue;
          const double* a = left.data() + static_cast<std::ptrdiff_t>(t) * deep;
          const double* b = right.data() + static_cast<std::ptrdiff_t>(column) * deep;
          double* to = target.data + column * target.stride + row;
          const Index tall = std::min(kTall, target.rows - row);
          const Index wide = std::min(kWide, target.columns - column);
          if (tall == kTall && wide == kWide)
            subtract_tile(a, b, deep, to, target.stride);
          else
            subtract_part(a, b, deep, to, target.stride, tall, wide);
        }
    });
  }
}

}  // namespace

Index eliminate_front(double* panel, double* schur, Index rows, Index own) {
  std::vector<double> diagonal(static_cast<std::size_t>(own));
  const std::ptrdiff_t stride = rows;
  for (Index begin = 0; begin < own; begin += kBlock) {
    const Index end = std::min(own, begin + kBlock);
    update({panel + begin * stride + begin, stride, rows - begin, end - begin}, panel, stride,
           begin, begin, begin, diagonal.data());
    for (Index c = begin; c < end; ++c) {
      diagonal[c] = panel[c * stride + c];
      if (!std::isfinite(diagonal[c]) || !std::isfinite(1.0 / diagonal[c])) return c;
      eliminate_column(panel, stride, c, end);
    }
    for_chunks(rows - end, kRows, [&](Index top, Index bottom) {
      eliminate_rows(panel, stride, begin, end, end + top, end + bottom);
    });
  }
  update({schur, stride - own, rows - own, rows - own}, panel, stride, own, own, own,
         diagonal.data());
  return -1;
}

// A step of an elimination with n unknowns left below takes n (n + 1).
double front_flops(double rows, double own) {
  const auto all = [](double n) { return (n - 1.0) * n * (n + 1.0) / 3.0; };
  return all(rows) - all(rows - own);
}

Rows normal_matrix(const RowsRef& A, const VecRef& weights) {
  const Index n = static_cast<Index>(A.cols());
  Rows product = Rows::Zero(n, n);
  const Vec negative = -weights;
  update({product.data(), n, n, n}, A.data(), n, 0, 0, static_cast<Index>(A.rows()),
         negative.data());
  product.triangularView<Eigen::StrictlyLower>() = product.transpose();
  return product;
}

Vec solve_dense(const RowsRef& A, const VecRef& b) {
  const Index n = static_cast<Index>(A.rows());
  if (A.cols() != n || b.size() != n) throw Error("SolverError", "A must be square, as long as b");
  Eigen::MatrixXd L = A.transpose();  // its columns are those of A, of which rows are given
  const Index failed = eliminate_front(L.data(), nullptr, n, n);
  if (failed >= 0 || !(L.diagonal().minCoeff() > 0.0))
    throw Error("SolverError", "the matrix is not positive definite");
  const Vec pivots = L.diagonal();
  L.diagonal().setOnes();
  Vec x = Vec::Zero(n);
  for (int pass = 0; pass < 2; ++pass) {  // once more for what rounding left
    Vec rest = b;
    for (Index j = 0; j < n; ++j) rest -= x(j) * A.row(j).transpose();
    for (Index j = 0; j < n; ++j) rest.tail(n - j - 1) -= rest(j) * L.col(j).tail(n - j - 1);
    rest.array() /= pivots.array();
    for (Index j = n; j-- > 0;)
      for (Index i = j + 1; i < n; ++i) rest(j) -= L(i, j) * rest(i);
    x += rest;
  }
  return x;
}

}  // namespace stretchmap::linalg
