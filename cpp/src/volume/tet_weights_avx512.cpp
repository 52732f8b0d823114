// Eight tets at once. Compiled for AVX-512 where the compiler can (CMakeLists.txt), empty
// elsewhere; includes nothing whose inline functions other files share.
#include "volume/tet_weights.hpp"

#if defined(__AVX512F__) && defined(__GNUC__)

#ifndef __clang__
// GCC sees its own header's "undefined" vectors as a mistake.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include <immintrin.h>

#include "volume/tet_weights_body.hpp"

namespace stretchmap::volume {
namespace {

struct Eight {
  static constexpr int kCount = 8;
  __m512d v;

  Eight() = default;
  Eight(__m512d value) : v(value) {}
  explicit Eight(double value) : v(_mm512_set1_pd(value)) {}
  static Eight load(const double* from) { return _mm512_loadu_pd(from); }
  void store(double* to) const { _mm512_store_pd(to, v); }
  friend Eight operator+(Eight a, Eight b) { return _mm512_add_pd(a.v, b.v); }
  friend Eight operator-(Eight a, Eight b) { return _mm512_sub_pd(a.v, b.v); }
  friend Eight operator*(Eight a, Eight b) { return _mm512_mul_pd(a.v, b.v); }
  friend Eight operator/(Eight a, Eight b) { return _mm512_div_pd(a.v, b.v); }
  friend Eight abs(Eight a) { return _mm512_abs_pd(a.v); }

  static void edges(const double* x, const std::int32_t* corners, Vector3<Eight>& b,
                    Vector3<Eight>& c, Vector3<Eight>& d) {
    // Tets `lane` and `lane` + 4 side by side.
    const auto pair = [&](int lane, int k) {
      const double* low = x + 4 * static_cast<std::int64_t>(corners[4 * lane + k]);
      const double* high = x + 4 * static_cast<std::int64_t>(corners[4 * (lane + 4) + k]);
      return _mm512_mask_broadcast_f64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(low)), 0xF0,
                                         _mm256_loadu_pd(high));
    };
    const __m512d from[4] = {pair(0, 0), pair(1, 0), pair(2, 0), pair(3, 0)};
    const __m512i low = _mm512_set_epi64(13, 12, 5, 4, 9, 8, 1, 0);
    const __m512i high = _mm512_set_epi64(15, 14, 7, 6, 11, 10, 3, 2);
    // unpack leaves lanes 0 1 | 4 5 per half; the permutations bring x, y and z of tets
    // 0 1 2 3 4 5 6 7 together.
    const auto edge = [&](int k) {
      const __m512d e0 = _mm512_sub_pd(pair(0, k), from[0]);
      const __m512d e1 = _mm512_sub_pd(pair(1, k), from[1]);
      const __m512d e2 = _mm512_sub_pd(pair(2, k), from[2]);
      const __m512d e3 = _mm512_sub_pd(pair(3, k), from[3]);
      const __m512d xz01 = _mm512_unpacklo_pd(e0, e1), xz23 = _mm512_unpacklo_pd(e2, e3);
      const __m512d y01 = _mm512_unpackhi_pd(e0, e1), y23 = _mm512_unpackhi_pd(e2, e3);
      return Vector3<Eight>{_mm512_permutex2var_pd(xz01, low, xz23),
                            _mm512_permutex2var_pd(y01, low, y23),
                            _mm512_permutex2var_pd(xz01, high, xz23)};
    };
    b = edge(1);
    c = edge(2);
    d = edge(3);
  }
};

void eight_at_once(const TetWeightsTask& task) { add_weights<Eight>(task); }

}  // namespace

TetWeightsKernel tet_weights_avx512() {
  return __builtin_cpu_supports("avx512f") ? eight_at_once : nullptr;
}

}  // namespace stretchmap::volume

#else

namespace stretchmap::volume {
TetWeightsKernel tet_weights_avx512() { return nullptr; }
}  // namespace stretchmap::volume

#endif
