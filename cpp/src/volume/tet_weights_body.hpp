// The loop itself, for any number of lanes. Included by one file per instruction set; everything
// has internal linkage, so that no code for one processor is ever shared with another.
//
// Lanes holds kCount numbers, one per tet, with load, store, arithmetic and
// edges(x, corners, b, c, d): the edge vectors from corner 0 of kCount successive tets.
#pragma once

#include "volume/tet_weights.hpp"

namespace stretchmap::volume {
namespace {

template <class Lanes>
struct Vector3 {
  Lanes x, y, z;
};

template <class Lanes>
inline Vector3<Lanes> cross(const Vector3<Lanes>& a, const Vector3<Lanes>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class Lanes>
inline Lanes dot(const Vector3<Lanes>& a, const Vector3<Lanes>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

// With b, c, d the edges from corner 0 and p = c x d, q = d x b, r = b x c the area vectors are
// -p/2, -q/2, -r/2 and (p + q + r)/2, and the volume is b . p / 6.
template <class Lanes>
inline void add_weights(const TetWeightsTask& task) {
  constexpr int kCount = Lanes::kCount;
  // Weights are read one by one well after they were written several at once, or the processor
  // would have to wait for each write.
  constexpr std::int64_t kBatch = 64;
  alignas(64) double weight[6][kBatch];
  for (std::int64_t first = 0; first < task.count; first += kBatch) {
    const std::int64_t count = task.count - first < kBatch ? task.count - first : kBatch;
    for (std::int64_t i = 0; i < count; i += kCount) {
      Vector3<Lanes> b, c, d;
      Lanes::edges(task.x, task.corners + 4 * (first + i), b, c, d);
      const Vector3<Lanes> p = cross(c, d), q = cross(d, b), r = cross(b, c);
      const Lanes pq = dot(p, q), pr = dot(p, r), qr = dot(q, r);
      const Lanes size =
          Lanes(36.0) * Lanes::load(task.rest + first + i) + Lanes(6.0 * task.c) * abs(dot(b, p));
      const Lanes factor = Lanes(1.0) / size, negative = Lanes(-1.0) / size;
      (negative * (dot(p, p) + pq + pr)).store(weight[0] + i);
      (negative * (pq + dot(q, q) + qr)).store(weight[1] + i);
      (negative * (pr + qr + dot(r, r))).store(weight[2] + i);
      (factor * pq).store(weight[3] + i);
      (factor * pr).store(weight[4] + i);
      (factor * qr).store(weight[5] + i);
    }
    const std::int32_t* slot = task.slots + 6 * first;
    for (std::int64_t i = 0; i < count; ++i, slot += 6)
      for (int s = 0; s < 6; ++s) task.sums[slot[s]] += weight[s][i];
  }
}

}  // namespace
}  // namespace stretchmap::volume
