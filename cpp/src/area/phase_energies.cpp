#include "stretchmap/area/phase_energies.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <vector>

#include "area/lanes.hpp"
#include "stretchmap/area/chart.hpp"
#include "stretchmap/base/clones.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"

namespace stretchmap::area {
namespace {

// Points of candidates that are rated at a time.
struct LanePoint {
  alignas(64) Lane at[3];
};

// The circle of the tube over one turn of the equal-area coordinate, tabulated with its slopes and
// interpolated by cubics: Kepler's equation once per entry instead of once per vertex and
// candidate.
class TubeTable {
 public:
  explicit TubeTable(double ratio) : points_(kEntries + 1, 4) {
    const double tube = 1.0 / ratio, step = kTwoPi / kEntries;
    double v = 0.0, slope = 1.0 / (1.0 + tube);
    for (Index i = 0; i <= kEntries / 2; ++i) {
      if (i > 0) v = equal_area_angle(step * i, tube, v + step * slope);
      const double c = std::cos(v), s = std::sin(v);
      slope = 1.0 / (1.0 + tube * c);
      points_.row(i) << c, s, -s * step * slope, c * step * slope;
      points_.row(kEntries - i) << c, -s, s * step * slope, c * step * slope;
    }
  }
  Eigen::Array<double, 1, 2> at(double turns) const {
    const double x = kEntries * (turns - std::floor(turns));
    const Index i = std::min(static_cast<Index>(x), kEntries - 1);
    const double t = x - i, rest = 1.0 - t;
    const auto from = points_.row(i), to = points_.row(i + 1);
    return rest * rest * ((1.0 + 2.0 * t) * from.head<2>() + t * from.tail<2>()) +
           t * t * ((1.0 + 2.0 * rest) * to.head<2>() - rest * to.tail<2>());
  }

 private:
  static constexpr Index kEntries = 512;
  Eigen::Array<double, Eigen::Dynamic, 4, Eigen::RowMajor> points_;
};

// Sums over the faces, from which the energy follows whatever the area of the image.
struct Sums {
  alignas(64) Lane area{};       // of the image
  alignas(64) Lane dirichlet{};  // |t| (s1^2 + s2^2)
  alignas(64) Lane inverse{};    // the same over the square of the ratio of areas
};

STRETCHMAP_CLONES
void add_faces(const SurfaceReference& reference, const FacesRef& faces, const LanePoint* image,
               Sums& sums) {
  for (Index f = 0; f < faces.rows(); ++f) {
    const LanePoint* corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = image + faces(f, k);
    alignas(64) Lane side[3][3], dirichlet{};
    for (int k = 0; k < 3; ++k) {
      const double half = 0.5 * reference.cotan(f, k);
      const LanePoint &from = *corner[(k + 1) % 3], &to = *corner[(k + 2) % 3];
      for (int i = 0; i < 3; ++i)
        for (int l = 0; l < kLanes; ++l) {
          side[k][i][l] = to.at[i][l] - from.at[i][l];
          dirichlet[l] += half * side[k][i][l] * side[k][i][l];
        }
    }
    const double squared = 4.0 * reference.areas(f) * reference.areas(f);
    for (int l = 0; l < kLanes; ++l) {
      const double x = side[1][1][l] * side[2][2][l] - side[1][2][l] * side[2][1][l];
      const double y = side[1][2][l] * side[2][0][l] - side[1][0][l] * side[2][2][l];
      const double z = side[1][0][l] * side[2][1][l] - side[1][1][l] * side[2][0][l];
      const double twice = x * x + y * y + z * z;
      sums.area[l] += 0.5 * std::sqrt(twice);
      sums.dirichlet[l] += dirichlet[l];
      sums.inverse[l] += dirichlet[l] * squared / twice;
    }
  }
}

}  // namespace

Vec phase_energies(const SurfaceReference& reference, const FacesRef& faces,
                   const Points2Ref& turns, const Points2Ref& candidates) {
  const Index n = static_cast<Index>(turns.rows()), count = static_cast<Index>(candidates.rows());
  std::map<double, TubeTable> tables;
  for (Index i = 0; i < count; ++i) tables.try_emplace(candidates(i, 1), candidates(i, 1));
  const Eigen::ArrayXd u = kTwoPi * turns.col(0).array();
  const Eigen::ArrayXd cos_u = u.cos(), sin_u = u.sin();
  Vec energies(count);
  for_tasks(chunk_count(count, kLanes), [&](Index batch) {
    std::vector<LanePoint> image(static_cast<std::size_t>(n));
    for (int l = 0; l < kLanes; ++l) {
      const Index c = std::min(kLanes * batch + l, count - 1);
      const double phase = candidates(c, 0), ratio = candidates(c, 1);
      const TubeTable& table = tables.at(ratio);
      for (Index k = 0; k < n; ++k) {
        const Eigen::Array<double, 1, 2> tube = table.at(turns(k, 1) + phase);
        const double axis = ratio + tube.x();
        image[k].at[0][l] = axis * cos_u(k);
        image[k].at[1][l] = axis * sin_u(k);
        image[k].at[2][l] = tube.y();
      }
    }
    Sums sums;
    add_faces(reference, faces, image.data(), sums);
    for (int l = 0; l < kLanes && kLanes * batch + l < count; ++l) {
      const double energy =
          0.25 * (sums.dirichlet[l] / sums.area[l] + sums.area[l] * sums.inverse[l]);
      energies[kLanes * batch + l] =
          std::isfinite(energy) ? energy : std::numeric_limits<double>::infinity();
    }
  });
  return energies;
}

}  // namespace stretchmap::area
