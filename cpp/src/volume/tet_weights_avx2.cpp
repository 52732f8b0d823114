// Four tets at once. Compiled for AVX2 where the compiler can (CMakeLists.txt), empty elsewhere;
// includes nothing whose inline functions other files share.
#include "volume/tet_weights.hpp"

#if defined(__AVX2__) && defined(__GNUC__)

#include <immintrin.h>

#include "volume/tet_weights_body.hpp"

namespace stretchmap::volume {
namespace {

struct Four {
  static constexpr int kCount = 4;
  __m256d v;

  Four() = default;
  Four(__m256d value) : v(value) {}
  explicit Four(double value) : v(_mm256_set1_pd(value)) {}
  static Four load(const double* from) { return _mm256_loadu_pd(from); }
  void store(double* to) const { _mm256_store_pd(to, v); }
  friend Four operator+(Four a, Four b) { return _mm256_add_pd(a.v, b.v); }
  friend Four operator-(Four a, Four b) { return _mm256_sub_pd(a.v, b.v); }
  friend Four operator*(Four a, Four b) { return _mm256_mul_pd(a.v, b.v); }
  friend Four operator/(Four a, Four b) { return _mm256_div_pd(a.v, b.v); }
  friend Four abs(Four a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a.v); }

  static void edges(const double* x, const std::int32_t* corners, Vector3<Four>& b,
                    Vector3<Four>& c, Vector3<Four>& d) {
    const auto point = [&](int lane, int k) {
      return _mm256_loadu_pd(x + 4 * static_cast<std::int64_t>(corners[4 * lane + k]));
    };
    const __m256d from[4] = {point(0, 0), point(1, 0), point(2, 0), point(3, 0)};
    const auto edge = [&](int k) {
      const __m256d e0 = _mm256_sub_pd(point(0, k), from[0]);
      const __m256d e1 = _mm256_sub_pd(point(1, k), from[1]);
      const __m256d e2 = _mm256_sub_pd(point(2, k), from[2]);
      const __m256d e3 = _mm256_sub_pd(point(3, k), from[3]);
      const __m256d xz01 = _mm256_unpacklo_pd(e0, e1), xz23 = _mm256_unpacklo_pd(e2, e3);
      const __m256d y01 = _mm256_unpackhi_pd(e0, e1), y23 = _mm256_unpackhi_pd(e2, e3);
      return Vector3<Four>{_mm256_permute2f128_pd(xz01, xz23, 0x20),
                           _mm256_permute2f128_pd(y01, y23, 0x20),
                           _mm256_permute2f128_pd(xz01, xz23, 0x31)};
    };
    b = edge(1);
    c = edge(2);
    d = edge(3);
  }
};

void four_at_once(const TetWeightsTask& task) { add_weights<Four>(task); }

}  // namespace

TetWeightsKernel tet_weights_avx2() {
  return __builtin_cpu_supports("avx2") ? four_at_once : nullptr;
}

}  // namespace stretchmap::volume

#else

namespace stretchmap::volume {
TetWeightsKernel tet_weights_avx2() { return nullptr; }
}  // namespace stretchmap::volume

#endif
