#include "stretchmap/volume/line_bound.hpp"

#include <algorithm>

#include "stretchmap/base/clones.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::volume {
namespace {

// What is left of a volume when a tet counts as flat.
constexpr double kFlat = 1e-6;
constexpr double kShortest = 1e-12;  // part of the line that is not divided further

// Cubic along a line, written round the point reached so far.
struct Cubic {
  double c0, c1, c2, c3;

  double at(double a) const { return c0 + a * (c1 + a * (c2 + a * c3)); }
  Cubic seen_from(double a) const {
    return {at(a), c1 + a * (2.0 * c2 + 3.0 * a * c3), c2 + 3.0 * a * c3, c3};
  }
  // Positive Bernstein coefficients on [0, h] prove that there is no root.
  bool positive_up_to(double h) const {
    return c0 > 0.0 && 3.0 * c0 + c1 * h > 0.0 && 3.0 * c0 + h * (2.0 * c1 + c2 * h) > 0.0 &&
           at(h) > 0.0;
  }
};

// \return how far in (0, limit] the cubic is proven positive, short of its first root by no more
//         than a value of kFlat times the first.
double positive_length(const Cubic& whole, double limit) {
  double reached = 0.0, h = limit;
  Cubic rest = whole;
  while (reached < limit && rest.c0 > kFlat * whole.c0 && h > kShortest * limit) {
    if (!rest.positive_up_to(h)) {
      h *= 0.5;
      continue;
    }
    reached += h;
    rest = whole.seen_from(reached);
    h = std::min(2.0 * h, limit - reached);
  }
  return std::min(reached, limit);
}

// Determinants along lines, E + alpha D, of several tets.
struct Cubics {
  alignas(64) Lane c[4];
  alignas(64) Lane positive;  // 1 where the Bernstein coefficients prove it up to the limit
};

// to += a . (b x c), of columns.
STRETCHMAP_INLINE void add_det(const Lane* a, const Lane* b, const Lane* c, Lane& to) {
  for (int l = 0; l < kLanes; ++l)
    to[l] += a[0][l] * (b[1][l] * c[2][l] - b[2][l] * c[1][l]) +
             a[1][l] * (b[2][l] * c[0][l] - b[0][l] * c[2][l]) +
             a[2][l] * (b[0][l] * c[1][l] - b[1][l] * c[0][l]);
}

STRETCHMAP_CLONES
void volumes_along(const Lane* E, const Lane* D, double limit, Cubics& out) {
  for (Lane& c : out.c)
    for (double& value : c) value = 0.0;
  add_det(E, E + 3, E + 6, out.c[0]);
  add_det(D, E + 3, E + 6, out.c[1]);
  add_det(E, D + 3, E + 6, out.c[1]);
  add_det(E, E + 3, D + 6, out.c[1]);
  add_det(D, D + 3, E + 6, out.c[2]);
  add_det(D, E + 3, D + 6, out.c[2]);
  add_det(E, D + 3, D + 6, out.c[2]);
  add_det(D, D + 3, D + 6, out.c[3]);
  for (int l = 0; l < kLanes; ++l) {
    const double c0 = out.c[0][l], c1 = limit * out.c[1][l], c2 = limit * limit * out.c[2][l];
    const double end = c0 + c1 + c2 + limit * limit * limit * out.c[3][l];
    const double least =
        std::min(std::min(c0, 3.0 * c0 + c1), std::min(3.0 * c0 + 2.0 * c1 + c2, end));
    out.positive[l] = least > 0.0 ? 1.0 : 0.0;
  }
}

}  // namespace

Vec longest_steps(const TetsRef& tets, const PointsRef& x, const PointsRef& direction,
                  double limit) {
  const Index k = static_cast<Index>(tets.rows());
  Vec longest = Vec::Constant(k, limit);
  for_rows(chunk_count(k, kLanes), kElementChunk / kLanes, [&](Index batch) {
    const Index first = kLanes * batch;
    alignas(64) Lane E[9], D[9];
    const int count = static_cast<int>(std::min<Index>(kLanes, k - first));
    for (int l = 0; l < kLanes; ++l) {
      const Index t = first + std::min(l, count - 1);
      const auto at = [&](int corner) { return 3 * static_cast<std::ptrdiff_t>(tets(t, corner)); };
      const double *from = x.data() + at(0), *along = direction.data() + at(0);
      for (int a = 0; a < 3; ++a) {
        const double *to = x.data() + at(a + 1), *there = direction.data() + at(a + 1);
        for (int i = 0; i < 3; ++i) {
          E[3 * a + i][l] = to[i] - from[i];
          D[3 * a + i][l] = there[i] - along[i];
        }
      }
    }
    Cubics volume;
    volumes_along(E, D, limit, volume);
    for (int l = 0; l < count; ++l) {
      if (volume.positive[l] > 0.0 || !(volume.c[0][l] > 0.0)) continue;
      longest[first + l] =
          positive_length({volume.c[0][l], volume.c[1][l], volume.c[2][l], volume.c[3][l]}, limit);
    }
  });
  return longest;
}

}  // namespace stretchmap::volume
