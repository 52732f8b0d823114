#include "volume/tet_weights.hpp"

#include <cmath>

#include "volume/tet_weights_body.hpp"

namespace stretchmap::volume {
namespace {

struct One {
  static constexpr int kCount = 1;
  double v;

  One() = default;
  explicit One(double value) : v(value) {}
  static One load(const double* from) { return One(*from); }
  void store(double* to) const { *to = v; }
  friend One operator+(One a, One b) { return One(a.v + b.v); }
  friend One operator-(One a, One b) { return One(a.v - b.v); }
  friend One operator*(One a, One b) { return One(a.v * b.v); }
  friend One operator/(One a, One b) { return One(a.v / b.v); }
  friend One abs(One a) { return One(std::abs(a.v)); }

  static void edges(const double* x, const std::int32_t* corners, Vector3<One>& b, Vector3<One>& c,
                    Vector3<One>& d) {
    const double* from = x + 4 * static_cast<std::int64_t>(corners[0]);
    const auto edge = [&](int k) {
      const double* to = x + 4 * static_cast<std::int64_t>(corners[k]);
      return Vector3<One>{One(to[0] - from[0]), One(to[1] - from[1]), One(to[2] - from[2])};
    };
    b = edge(1);
    c = edge(2);
    d = edge(3);
  }
};

void one_by_one(const TetWeightsTask& task) { add_weights<One>(task); }

}  // namespace

TetWeightsKernel tet_weights_kernel(int max_lanes) {
  if (max_lanes >= 8 && tet_weights_avx512()) return tet_weights_avx512();
  if (max_lanes >= 4 && tet_weights_avx2()) return tet_weights_avx2();
  return one_by_one;
}

}  // namespace stretchmap::volume
