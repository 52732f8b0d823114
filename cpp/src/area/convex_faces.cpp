#include "area/convex_faces.hpp"

#include <algorithm>
#include <cmath>

#include "area/lanes.hpp"
#include "stretchmap/base/clones.hpp"
#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::area {

namespace {

constexpr int kSize = 6, kSweeps = 12;
using SixSix = Eigen::Matrix<double, kSize, kSize>;

// Symmetric matrices, one in each lane: A = Q' D Q in the end. The rows of A are its columns, too.
struct Matrices {
  alignas(64) Lane A[kSize][kSize];
  alignas(64) Lane Q[kSize][kSize];
  alignas(64) Lane open;   // 1 while the lane goes on: its result must not depend on the others
  alignas(64) Lane worst;  // of this sweep
};

// Rows p and q turned into each other.
STRETCHMAP_INLINE void turn(Lane* p, Lane* q, const Lane& cs, const Lane& sn) {
  for (int k = 0; k < kSize; ++k) {
    alignas(64) Lane first, second;
    for (int l = 0; l < kLanes; ++l) {
      first[l] = cs[l] * p[k][l] - sn[l] * q[k][l];
      second[l] = sn[l] * p[k][l] + cs[l] * q[k][l];
    }
    for (int l = 0; l < kLanes; ++l) p[k][l] = first[l];
    for (int l = 0; l < kLanes; ++l) q[k][l] = second[l];
  }
}

// The rotation of rows and columns p and q that annihilates entry (p, q).
STRETCHMAP_INLINE void annihilate(Matrices& m, int p, int q) {
  alignas(64) Lane cs, sn, off, square, app, aqq, apq;
  for (int l = 0; l < kLanes; ++l) square[l] = 0.0;
  for (int i = 0; i < kSize; ++i)
    for (int l = 0; l < kLanes; ++l) square[l] += m.A[i][i][l] * m.A[i][i][l];
  for (int l = 0; l < kLanes; ++l) {
    const double a = m.A[p][p][l], b = m.A[q][q][l], c = m.A[p][q][l];
    const bool done = (c * c <= 1e-32 * square[l]) | (m.open[l] == 0.0);
    off[l] = done ? 0.0 : c * c / (done ? 1.0 : square[l]);
    const double zeta = (b - a) / (done ? 1.0 : 2.0 * c);
    const double size = 1.0 / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
    const double t = done ? 0.0 : (zeta >= 0.0 ? size : -size);
    cs[l] = 1.0 / std::sqrt(1.0 + t * t);
    sn[l] = cs[l] * t;
    app[l] = a - t * c;
    aqq[l] = b + t * c;
    apq[l] = done ? c : 0.0;
  }
  for (int l = 0; l < kLanes; ++l) m.worst[l] = m.worst[l] < off[l] ? off[l] : m.worst[l];
  turn(m.A[p], m.A[q], cs, sn);
  turn(m.Q[p], m.Q[q], cs, sn);
  for (int l = 0; l < kLanes; ++l) {
    m.A[p][p][l] = app[l];
    m.A[q][q][l] = aqq[l];
    m.A[p][q][l] = apq[l];
    m.A[q][p][l] = apq[l];
  }
  for (int k = 0; k < kSize; ++k) {
    if (k == p || k == q) continue;
    for (int l = 0; l < kLanes; ++l) m.A[k][p][l] = m.A[p][k][l];
    for (int l = 0; l < kLanes; ++l) m.A[k][q][l] = m.A[q][k][l];
  }
}

// The matrices without their negative eigenvalues (two-sided Jacobi).
STRETCHMAP_CLONES void take_negative(Matrices& m) {
  for (int i = 0; i < kSize; ++i)
    for (int j = 0; j < kSize; ++j)
      for (int l = 0; l < kLanes; ++l) m.Q[i][j][l] = i == j ? 1.0 : 0.0;
  for (int l = 0; l < kLanes; ++l) m.open[l] = 1.0;
  double any = 1.0;
  for (int sweep = 0; sweep < kSweeps && any > 0.0; ++sweep) {
    for (int l = 0; l < kLanes; ++l) m.worst[l] = 0.0;
    for (int p = 0; p < kSize; ++p)
      for (int q = p + 1; q < kSize; ++q) annihilate(m, p, q);
    any = 0.0;
    // Convergence is quadratic: what is left after a sweep that found 1e-12 (a square) is no more.
    for (int l = 0; l < kLanes; ++l) {
      m.open[l] = m.worst[l] < 1e-12 ? 0.0 : m.open[l];
      any += m.open[l];
    }
  }
  alignas(64) Lane kept[kSize];
  for (int k = 0; k < kSize; ++k)
    for (int l = 0; l < kLanes; ++l) kept[k][l] = std::max(m.A[k][k][l], 0.0);
  for (int i = 0; i < kSize; ++i)
    for (int j = i; j < kSize; ++j) {
      alignas(64) Lane sum = {};
      for (int k = 0; k < kSize; ++k)
        for (int l = 0; l < kLanes; ++l) sum[l] += kept[k][l] * m.Q[k][i][l] * m.Q[k][j][l];
      for (int l = 0; l < kLanes; ++l) m.A[i][j][l] = sum[l];
      for (int l = 0; l < kLanes; ++l) m.A[j][i][l] = sum[l];
    }
}

bool is_convex(const double* hessian) {
  SixSix matrix = Eigen::Map<const SixSix>(hessian);
  matrix.diagonal().array() += 1e-12 * matrix.diagonal().cwiseAbs().maxCoeff();
  return linalg::is_positive_definite(matrix);
}

}  // namespace

void make_convex(Rows& hessians, Index begin, Index end) {
  Matrices m;
  Index rows[kLanes];
  int count = 0;
  for (Index f = begin; f < end; ++f) {
    if (!is_convex(hessians.row(f).data())) {
      rows[count] = f;
      for (int k = 0; k < kSize * kSize; ++k) m.A[k / kSize][k % kSize][count] = hessians(f, k);
      ++count;
    }
    if (count == 0 || (count < kLanes && f + 1 < end)) continue;
    for (auto& row : m.A)
      for (Lane& entry : row) std::fill(entry + count, entry + kLanes, entry[0]);
    take_negative(m);
    for (int l = 0; l < count; ++l)
      for (int k = 0; k < kSize * kSize; ++k) hessians(rows[l], k) = m.A[k / kSize][k % kSize][l];
    count = 0;
  }
}

}  // namespace stretchmap::area
