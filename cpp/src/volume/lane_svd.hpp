// Singular values and positive parts of 3x3 matrices, several at a time without branches, so that
// the loops over lanes become vector instructions.
#pragma once

#include <algorithm>
#include <cmath>

#include "stretchmap/base/clones.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::volume {

// J = U diag(sigma) V^T with rotations U and V, as in signed_svd.hpp. Index 3 column + row.
struct LaneSvd {
  alignas(64) Lane U[9], V[9];
  alignas(64) Lane sigma[3];  // |sigma_0| >= |sigma_1| >= |sigma_2|; only sigma_2 may be negative
};

// A lane stops as soon as it has converged itself: its result must not depend on the others.
struct LaneSweep {
  alignas(64) Lane worst;  // of this sweep
  alignas(64) Lane open;   // 1 while the lane goes on

  STRETCHMAP_INLINE LaneSweep() {
    for (int l = 0; l < kLanes; ++l) worst[l] = open[l] = 1.0;
  }
  // Whether any lane has to go on. Convergence is quadratic: what is left after a sweep that found
  // 1e-12 (a square) is no more than that, and what comes out is a model Hessian.
  STRETCHMAP_INLINE bool next() {
    double any = 0.0;
    for (int l = 0; l < kLanes; ++l) {
      open[l] = worst[l] < 1e-12 ? 0.0 : open[l];
      any += open[l];
      worst[l] = 0.0;
    }
    return any > 0.0;
  }
};

// Columns p and q of B and V turned so that those of B become orthogonal (one-sided Jacobi).
STRETCHMAP_INLINE void lane_rotate(Lane* B, Lane* V, int p, int q, LaneSweep& state) {
  for (int l = 0; l < kLanes; ++l) {
    double bp[3], bq[3], a = 0.0, b = 0.0, c = 0.0;
    for (int i = 0; i < 3; ++i) {
      bp[i] = B[3 * p + i][l];
      bq[i] = B[3 * q + i][l];
      a += bp[i] * bp[i];
      b += bq[i] * bq[i];
      c += bp[i] * bq[i];
    }
    const double scale = a * b;
    const bool done = (c * c <= 1e-30 * scale) | (state.open[l] == 0.0);
    const double off = done ? 0.0 : c * c / (done ? 1.0 : scale);
    state.worst[l] = state.worst[l] < off ? off : state.worst[l];
    const double zeta = (b - a) / (done ? 1.0 : 2.0 * c);
    const double size = 1.0 / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
    const double t = done ? 0.0 : (zeta >= 0.0 ? size : -size);
    const double cs = 1.0 / std::sqrt(1.0 + t * t), sn = cs * t;
    for (int i = 0; i < 3; ++i) {
      B[3 * p + i][l] = cs * bp[i] - sn * bq[i];
      B[3 * q + i][l] = sn * bp[i] + cs * bq[i];
      const double vp = V[3 * p + i][l], vq = V[3 * q + i][l];
      V[3 * p + i][l] = cs * vp - sn * vq;
      V[3 * q + i][l] = sn * vp + cs * vq;
    }
  }
}

// Exchanges columns p and q where q is longer; one of them changes sign so that V stays a rotation.
STRETCHMAP_INLINE void lane_order(Lane* B, Lane* V, int p, int q) {
  for (int l = 0; l < kLanes; ++l) {
    double a = 0.0, b = 0.0;
    for (int i = 0; i < 3; ++i) {
      a += B[3 * p + i][l] * B[3 * p + i][l];
      b += B[3 * q + i][l] * B[3 * q + i][l];
    }
    const bool swap = a < b;
    for (Lane* M : {B, V}) {
      for (int i = 0; i < 3; ++i) {
        const double first = M[3 * p + i][l], second = M[3 * q + i][l];
        M[3 * p + i][l] = swap ? second : first;
        M[3 * q + i][l] = swap ? -first : second;
      }
    }
  }
}

// The singular values, and the left vectors as an orthonormal basis, from the ordered columns.
STRETCHMAP_INLINE void lane_basis(const Lane* B, LaneSvd& out) {
  for (int l = 0; l < kLanes; ++l) {
    const double b0[3] = {B[0][l], B[1][l], B[2][l]}, b1[3] = {B[3][l], B[4][l], B[5][l]};
    const double s0 = std::sqrt(b0[0] * b0[0] + b0[1] * b0[1] + b0[2] * b0[2]);
    const double s1 = std::sqrt(b1[0] * b1[0] + b1[1] * b1[1] + b1[2] * b1[2]);
    const bool zero = !(s0 > 0.0);
    const double inverse = 1.0 / (zero ? 1.0 : s0);
    const double u[3] = {zero ? 1.0 : b0[0] * inverse, b0[1] * inverse, b0[2] * inverse};
    const double along = u[0] * b1[0] + u[1] * b1[1] + u[2] * b1[2];
    // Rank one: any direction orthogonal to the first will do.
    const bool rank_one = !(s1 > 1e-14 * s0);
    const bool flat = std::abs(u[0]) < 0.6;
    const double x = rank_one ? (flat ? 0.0 : -u[2]) : b1[0] - along * u[0];
    const double y = rank_one ? (flat ? u[2] : 0.0) : b1[1] - along * u[1];
    const double z = rank_one ? (flat ? -u[1] : u[0]) : b1[2] - along * u[2];
    const double length = 1.0 / std::sqrt(x * x + y * y + z * z);
    const double w[3] = {x * length, y * length, z * length};
    const double n[3] = {u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2],
                         u[0] * w[1] - u[1] * w[0]};
    for (int i = 0; i < 3; ++i) {
      out.U[i][l] = u[i];
      out.U[3 + i][l] = w[i];
      out.U[6 + i][l] = n[i];
    }
    out.sigma[0][l] = s0;
    out.sigma[1][l] = rank_one ? 0.0 : s1;
    out.sigma[2][l] = n[0] * B[6][l] + n[1] * B[7][l] + n[2] * B[8][l];
  }
}

STRETCHMAP_INLINE void lane_svd(const Lane* J, LaneSvd& out) {
  alignas(64) Lane B[9];
  for (int k = 0; k < 9; ++k)
    for (int l = 0; l < kLanes; ++l) {
      B[k][l] = J[k][l];
      out.V[k][l] = k % 4 == 0 ? 1.0 : 0.0;
    }
  LaneSweep state;
  for (int sweep = 0; sweep < 12 && state.next(); ++sweep) {
    lane_rotate(B, out.V, 0, 1, state);
    lane_rotate(B, out.V, 0, 2, state);
    lane_rotate(B, out.V, 1, 2, state);
  }
  lane_order(B, out.V, 0, 1);
  lane_order(B, out.V, 0, 2);
  lane_order(B, out.V, 1, 2);
  lane_basis(B, out);
}

// Rotation of rows and columns p and q of the symmetric A that annihilates its entry (p, q).
STRETCHMAP_INLINE void lane_annihilate(Lane* A, Lane* Q, int p, int q, LaneSweep& state) {
  const int k = 3 - p - q;
  for (int l = 0; l < kLanes; ++l) {
    const double app = A[4 * p][l], aqq = A[4 * q][l], apq = A[3 * p + q][l];
    const double scale = A[0][l] * A[0][l] + A[4][l] * A[4][l] + A[8][l] * A[8][l];
    const bool done = (apq * apq <= 1e-32 * scale) | (state.open[l] == 0.0);
    const double off = done ? 0.0 : apq * apq / (done ? 1.0 : scale);
    state.worst[l] = state.worst[l] < off ? off : state.worst[l];
    const double zeta = (aqq - app) / (done ? 1.0 : 2.0 * apq);
    const double size = 1.0 / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
    const double t = done ? 0.0 : (zeta >= 0.0 ? size : -size);
    const double cs = 1.0 / std::sqrt(1.0 + t * t), sn = cs * t;
    const double akp = A[3 * k + p][l], akq = A[3 * k + q][l];
    A[4 * p][l] = app - t * apq;
    A[4 * q][l] = aqq + t * apq;
    A[3 * p + q][l] = A[3 * q + p][l] = done ? apq : 0.0;
    A[3 * k + p][l] = A[3 * p + k][l] = cs * akp - sn * akq;
    A[3 * k + q][l] = A[3 * q + k][l] = sn * akp + cs * akq;
    for (int i = 0; i < 3; ++i) {
      const double qp = Q[3 * p + i][l], qq = Q[3 * q + i][l];
      Q[3 * p + i][l] = cs * qp - sn * qq;
      Q[3 * q + i][l] = sn * qp + cs * qq;
    }
  }
}

// The symmetric A with its negative eigenvalues multiplied by a factor in [0, 1) (two-sided
// Jacobi).
STRETCHMAP_INLINE void lane_damp_negative(Lane* A, double factor, Lane* out) {
  alignas(64) Lane Q[9];
  for (int k = 0; k < 9; ++k)
    for (int l = 0; l < kLanes; ++l) Q[k][l] = k % 4 == 0 ? 1.0 : 0.0;
  LaneSweep state;
  for (int sweep = 0; sweep < 12 && state.next(); ++sweep) {
    lane_annihilate(A, Q, 0, 1, state);
    lane_annihilate(A, Q, 0, 2, state);
    lane_annihilate(A, Q, 1, 2, state);
  }
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j)
      for (int l = 0; l < kLanes; ++l) {
        double sum = 0.0;
        for (int k = 0; k < 3; ++k)
          sum += std::max(A[4 * k][l], factor * A[4 * k][l]) * Q[3 * k + i][l] * Q[3 * k + j][l];
        out[3 * i + j][l] = out[3 * j + i][l] = sum;
      }
}

}  // namespace stretchmap::volume
