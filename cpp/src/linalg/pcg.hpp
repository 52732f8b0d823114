// Preconditioned conjugate gradients for K independent right-hand sides that share every pass over
// the matrix. Vectors are interleaved: entry (row, k) is v[K row + k].
#pragma once

#include <array>
#include <functional>

#include "stretchmap/linalg/solve.hpp"

namespace stretchmap::linalg {

// Columns solved together; three right-hand sides travel as four, the last one zero.
inline int padded_columns(Index k) { return k >= 3 ? 4 : static_cast<int>(k); }

struct PcgSystem {
  Index n = 0;                                               // rows
  std::function<void(const double*, double*)> apply;         // y = A x, K columns
  std::function<void(const double*, double*)> precondition;  // z = M r, K columns, M SPD
};

template <int K>
struct PcgResult {
  int iterations = 0;
  std::array<double, K> residual{};  // true relative residual
  double digits = 0.0;               // decimal digits gained by the slowest column
  bool negative_curvature = false;   // p'Ap <= 0 was met: the iterate before it is returned
  bool finite = true;                // false: a NaN or an infinity was met
};

// x: warm start in, solution out. A column with b = 0 gives x = 0 and residual 0.
template <int K>
PcgResult<K> pcg(const PcgSystem& system, const double* b, double* x, const SolveOptions& options,
                 const Poll& poll);

extern template PcgResult<1> pcg<1>(const PcgSystem&, const double*, double*, const SolveOptions&,
                                    const Poll&);
extern template PcgResult<2> pcg<2>(const PcgSystem&, const double*, double*, const SolveOptions&,
                                    const Poll&);
extern template PcgResult<4> pcg<4>(const PcgSystem&, const double*, double*, const SolveOptions&,
                                    const Poll&);

}  // namespace stretchmap::linalg
