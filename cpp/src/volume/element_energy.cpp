#include "stretchmap/volume/element_energy.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>

#include "stretchmap/base/clones.hpp"
#include "volume/lane_svd.hpp"

namespace stretchmap::volume {
namespace {

// J and its cofactors, component-wise; index 3 column + row.
struct Jacobians {
  alignas(64) Lane J[9];
  alignas(64) Lane cofactor[9];
  alignas(64) Lane det;
  alignas(64) Lane squared;  // tr J^T J
};

STRETCHMAP_INLINE void jacobians(const ElementBatch& batch, Jacobians& out) {
  for (int c = 0; c < 3; ++c)
    for (int i = 0; i < 3; ++i)
      for (int l = 0; l < kLanes; ++l)
        out.J[3 * c + i][l] = batch.edges[i][l] * batch.rest[c][l] +
                              batch.edges[3 + i][l] * batch.rest[3 + c][l] +
                              batch.edges[6 + i][l] * batch.rest[6 + c][l];
  for (int c = 0; c < 3; ++c) {
    const int p = 3 * ((c + 1) % 3), q = 3 * ((c + 2) % 3);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      for (int l = 0; l < kLanes; ++l)
        out.cofactor[3 * c + i][l] =
            out.J[p + j][l] * out.J[q + k][l] - out.J[p + k][l] * out.J[q + j][l];
    }
  }
  for (int l = 0; l < kLanes; ++l) {
    out.det[l] = out.J[0][l] * out.cofactor[0][l] + out.J[1][l] * out.cofactor[1][l] +
                 out.J[2][l] * out.cofactor[2][l];
    double sum = 0.0;
    for (int k = 0; k < 9; ++k) sum += out.J[k][l] * out.J[k][l];
    out.squared[l] = sum;
  }
}

// Of positive numbers, to rounding; finite or NaN for others. A third of the exponent and Halley's
// iteration three times, from an error of 5 % to 2e-5, 4e-15 and none.
STRETCHMAP_INLINE void cube_roots(const Lane& of, Lane& root) {
  alignas(64) std::uint64_t bits[kLanes];
  std::memcpy(bits, of, sizeof(bits));
  for (int l = 0; l < kLanes; ++l) {
    const std::uint64_t third = ((bits[l] >> 32) * 0xAAAAAAABu) >> 33;
    bits[l] = (third + 715094163u) << 32;
  }
  std::memcpy(root, bits, sizeof(bits));
  for (int pass = 0; pass < 3; ++pass)
    for (int l = 0; l < kLanes; ++l) {
      const double cube = root[l] * root[l] * root[l];
      root[l] *= (cube + 2.0 * of[l]) / (2.0 * cube + of[l]);
    }
}

// psi as a function of I = tr(J^T J) and D = det J: psi = a(D) I + b(D).
struct Terms {
  alignas(64) Lane a, a1, a2;  // a and its derivatives in D
  alignas(64) Lane b, b1, b2;
};

STRETCHMAP_INLINE void terms(const Lane& det, const Lane& own, const EnergyWeights& w, Terms& t) {
  alignas(64) Lane chi, chi1, chi2, root;
  const double square = w.epsilon > 0.0 ? w.epsilon * w.epsilon : 0.0;
  for (int l = 0; l < kLanes; ++l) {
    const Regularized r = regularized_by_square(det[l], square > 0.0 ? square + own[l] : 0.0);
    chi[l] = r.value;
    chi1[l] = r.first;
    chi2[l] = r.second;
  }
  cube_roots(chi, root);
  const double c = w.shape / 3.0, m = 0.5 * w.volume;
  for (int l = 0; l < kLanes; ++l) {
    const double q = 1.0 / chi[l], N = det[l] * det[l] + 1.0;
    const double a = c / (root[l] * root[l]);
    t.a[l] = a;
    t.a1[l] = -2.0 / 3.0 * a * q * chi1[l];
    t.a2[l] = -2.0 / 3.0 * a * q * (chi2[l] - 5.0 / 3.0 * chi1[l] * chi1[l] * q);
    t.b[l] = m * N * q - w.shape - w.volume;
    t.b1[l] = m * (2.0 * det[l] * q - N * q * q * chi1[l]);
    t.b2[l] = m * (2.0 * q - 4.0 * det[l] * q * q * chi1[l] +
                   2.0 * N * q * q * q * chi1[l] * chi1[l] - N * q * q * chi2[l]);
  }
}

STRETCHMAP_INLINE void energies(ElementBatch& batch, const EnergyWeights& w, const Jacobians& j,
                                const Terms& t) {
  const bool barrier = w.epsilon <= 0.0;
  for (int l = 0; l < kLanes; ++l) {
    batch.det[l] = j.det[l];
    const double finite = batch.weight[l] * (t.a[l] * j.squared[l] + t.b[l]);
    const bool inverted = barrier && !(j.det[l] > 0.0);
    batch.energy[l] = inverted ? std::numeric_limits<double>::infinity() : finite;
  }
}

// d psi / dJ = 2 a J + slope * cofactor, contracted with the rest matrix.
STRETCHMAP_INLINE void gradients(ElementBatch& batch, const Jacobians& j, const Terms& t,
                                 const Lane& slope) {
  alignas(64) Lane P[9];
  for (int k = 0; k < 9; ++k)
    for (int l = 0; l < kLanes; ++l)
      P[k][l] = batch.weight[l] * (2.0 * t.a[l] * j.J[k][l] + slope[l] * j.cofactor[k][l]);
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i)
      for (int l = 0; l < kLanes; ++l)
        batch.gradient[3 * a + i][l] = P[i][l] * batch.rest[3 * a][l] +
                                       P[3 + i][l] * batch.rest[3 * a + 1][l] +
                                       P[6 + i][l] * batch.rest[3 * a + 2][l];
}

// The Hessian in the basis of the singular vectors. Along the diagonal of U^T dJ V it is the 3x3
// matrix A; off the diagonal the pair (i, j) has the eigenvalue
// twist on the antisymmetric and flip on the symmetric part.
struct Modes {
  alignas(64) Lane A[9];
  alignas(64) Lane half[3];  // (twist + flip) / 2 of the pair without k
  alignas(64) Lane odd[3];   // (flip - twist) / 2
};

STRETCHMAP_INLINE void modes(const Lane (&sigma)[3], const Lane& squared, const Terms& t,
                             const Lane& slope, double negative, Modes& out) {
  alignas(64) Lane d[3], curvature;
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < kLanes; ++l)
      d[k][l] = sigma[(k + 1) % 3][l] * sigma[(k + 2) % 3][l];  // d det / d sigma
  for (int l = 0; l < kLanes; ++l) curvature[l] = t.a2[l] * squared[l] + t.b2[l];
  alignas(64) Lane A[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int l = 0; l < kLanes; ++l) {
        const double mixed = 2.0 * t.a1[l] * (sigma[i][l] * d[j][l] + sigma[j][l] * d[i][l]) +
                             curvature[l] * d[i][l] * d[j][l];
        A[3 * i + j][l] =
            mixed + (i == j ? 2.0 * t.a[l] : slope[l] * sigma[i == j ? 0 : 3 - i - j][l]);
      }
  lane_damp_negative(A, negative, out.A);
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < kLanes; ++l) {
      const double mean = 2.0 * t.a[l], part = slope[l] * sigma[k][l];
      const double twist = std::max(mean + part, negative * (mean + part));
      const double flip = std::max(mean - part, negative * (mean - part));
      out.half[k][l] = 0.5 * (twist + flip);
      out.odd[k][l] = 0.5 * (flip - twist);
    }
}

// Block (a, b) of the Hessian by vertices: U B U^T with B from the modes and g = V^T rest^T.
STRETCHMAP_INLINE void block(const LaneSvd& svd, const Modes& m, const Lane* ga, const Lane* gb,
                             const Lane& weight, Lane* out) {
  alignas(64) Lane B[9], UB[9];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    for (int l = 0; l < kLanes; ++l) {
      // The pair without k is (i, j), the one without j is (i, k).
      B[3 * i + i][l] =
          weight[l] * (m.A[3 * i + i][l] * ga[i][l] * gb[i][l] +
                       m.half[k][l] * ga[j][l] * gb[j][l] + m.half[j][l] * ga[k][l] * gb[k][l]);
      B[3 * i + j][l] =
          weight[l] * (m.A[3 * i + j][l] * ga[i][l] * gb[j][l] + m.odd[k][l] * ga[j][l] * gb[i][l]);
      B[3 * i + k][l] =
          weight[l] * (m.A[3 * i + k][l] * ga[i][l] * gb[k][l] + m.odd[j][l] * ga[k][l] * gb[i][l]);
    }
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int l = 0; l < kLanes; ++l)
        UB[3 * i + j][l] =
            svd.U[i][l] * B[j][l] + svd.U[3 + i][l] * B[3 + j][l] + svd.U[6 + i][l] * B[6 + j][l];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int l = 0; l < kLanes; ++l)
        out[3 * i + j][l] = UB[3 * i][l] * svd.U[j][l] + UB[3 * i + 1][l] * svd.U[3 + j][l] +
                            UB[3 * i + 2][l] * svd.U[6 + j][l];
}

}  // namespace

STRETCHMAP_CLONES
void element_values(ElementBatch& batch, const EnergyWeights& w) {
  Jacobians j;
  Terms t;
  jacobians(batch, j);
  terms(j.det, batch.own, w, t);
  energies(batch, w, j, t);
}

STRETCHMAP_CLONES
void element_gradients(ElementBatch& batch, const EnergyWeights& w) {
  Jacobians j;
  Terms t;
  jacobians(batch, j);
  terms(j.det, batch.own, w, t);
  energies(batch, w, j, t);
  alignas(64) Lane slope;  // d psi / dD
  for (int l = 0; l < kLanes; ++l) slope[l] = t.a1[l] * j.squared[l] + t.b1[l];
  gradients(batch, j, t, slope);
}

STRETCHMAP_CLONES
void element_models(ElementBatch& batch, const EnergyWeights& w) {
  Jacobians j;
  Terms t;
  jacobians(batch, j);
  terms(j.det, batch.own, w, t);
  energies(batch, w, j, t);
  alignas(64) Lane slope;  // d psi / dD
  for (int l = 0; l < kLanes; ++l) slope[l] = t.a1[l] * j.squared[l] + t.b1[l];
  gradients(batch, j, t, slope);

  LaneSvd svd;
  lane_svd(j.J, svd);
  Modes m;
  modes(svd.sigma, j.squared, t, slope, w.negative, m);
  alignas(64) Lane g[3][3];  // V^T times the rows of the rest matrix
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i)
      for (int l = 0; l < kLanes; ++l)
        g[a][i][l] = svd.V[3 * i][l] * batch.rest[3 * a][l] +
                     svd.V[3 * i + 1][l] * batch.rest[3 * a + 1][l] +
                     svd.V[3 * i + 2][l] * batch.rest[3 * a + 2][l];
  int at = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = a; b < 3; ++b) block(svd, m, g[a], g[b], batch.weight, batch.block[at++]);
}

}  // namespace stretchmap::volume
