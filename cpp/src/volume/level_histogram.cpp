#include "stretchmap/volume/level_histogram.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::volume {
namespace {

constexpr Index kRun = 8192;  // tets added up by one thread, whatever the number of threads

// Bins of the four quadrature points of a tet.
class Bins {
 public:
  Bins(const TetsRef& tets, const VecRef& values, Index bins, double period, bool periodic)
      : tets_(tets), values_(values), bins_(bins), period_(period), periodic_(periodic) {}

  std::array<Index, 4> operator()(Index t) const {
    const double far = (5.0 - std::sqrt(5.0)) / 20.0, near = 1.0 - 3.0 * far;
    std::array<double, 4> value;
    for (int a = 0; a < 4; ++a) {
      value[a] = values_[tets_(t, a)];
      if (!periodic_) continue;
      const double offset = value[a] - value[0];
      if (offset > 0.5 * period_) value[a] -= period_;
      if (offset < -0.5 * period_) value[a] += period_;
    }
    const double common = far * (value[0] + value[1] + value[2] + value[3]);
    std::array<Index, 4> bin;
    for (int a = 0; a < 4; ++a) {
      double point = (common + (near - far) * value[a]) / period_;
      if (periodic_) point -= std::floor(point);
      if (!(point >= 0.0)) point = 0.0;
      bin[a] = static_cast<Index>(std::clamp(point * bins_, 0.0, bins_ - 1.0));
    }
    return bin;
  }

 private:
  const TetsRef& tets_;
  const VecRef& values_;
  Index bins_;
  double period_;
  bool periodic_;
};

}  // namespace

Points2 level_histogram(const TetsRef& tets, const VecRef& values, const Points2Ref& amounts,
                        Index bins, double period, bool periodic) {
  const Bins bins_of(tets, values, bins, period, periodic);
  const Index k = static_cast<Index>(tets.rows()), runs = (k + kRun - 1) / kRun;
  std::vector<Points2> partial(runs);
  for_tasks(runs, [&](Index run) {
    Points2& sums = partial[run];
    sums.setZero(bins, 2);
    for (Index t = kRun * run; t < std::min(k, kRun * (run + 1)); ++t)
      for (const Index bin : bins_of(t)) sums.row(bin) += 0.25 * amounts.row(t);
  });
  Points2 histogram = Points2::Zero(bins, 2);
  for (const Points2& sums : partial) histogram += sums;
  return histogram;
}

Vec level_lookup(const TetsRef& tets, const VecRef& values, const VecRef& table, double period,
                 bool periodic) {
  const Bins bins_of(tets, values, static_cast<Index>(table.size()), period, periodic);
  Vec mean = Vec::Zero(tets.rows());
  for_rows(static_cast<Index>(tets.rows()), [&](Index t) {
    for (const Index bin : bins_of(t)) mean[t] += 0.25 * table[bin];
  });
  return mean;
}

}  // namespace stretchmap::volume
