// Notices when an old hierarchy no longer fits the values it is used with.
#pragma once

#include <algorithm>

namespace stretchmap::linalg {

class ConvergenceWatch {
 public:
  // The hierarchy was built from the present values.
  void reset() { *this = {}; }
  // A solve took so many iterations to gain `digits` decimal digits.
  void observe(int iterations, double digits) {
    if (iterations < 4 || digits < 0.5) return;
    const double cost = iterations / digits;
    if (fresh_ <= 0.0) fresh_ = cost;
    worn_ = cost > 1.6 * fresh_;
  }
  // A solve broke down on it.
  void fail() { worn_ = true; }
  // The last solve broke down or cost over 60 percent more per digit than the first one after the
  // setup.
  bool worn() const { return worn_; }

 private:
  double fresh_ = 0.0;  // iterations per digit of the first solve
  bool worn_ = false;
};

}  // namespace stretchmap::linalg
