// Preconditioned conjugate gradients for K independent right-hand sides that share every pass over
// the matrix. Vectors are interleaved: entry (row, k) is v[K row + k].
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "stretchmap/base/buffer.hpp"
#include "stretchmap/linalg/solve.hpp"

namespace stretchmap::linalg {

template <int K>
struct PcgSystem {
  Index n = 0;  // rows
  // y = A x; returns x'y of each column.
  std::function<std::array<double, K>(const double*, double*)> apply;
  // z = M r with M symmetric positive definite. Single precision: b should be of moderate size.
  std::function<void(const float*, float*)> precondition;
  // change = A z - r after that: less work than a product, but rounding in z counts in full. Empty:
  // products are made.
  std::function<void(const float* z, float* change)> unbalanced;
};

template <int K>
struct PcgResult {
  int iterations = 0;
  std::array<double, K> residual{};  // true relative residual
  double digits = 0.0;               // decimal digits gained by the slowest column
  bool negative_curvature = false;   // p'Ap <= 0 was met: the iterate before it is returned
  bool finite = true;                // false: a NaN or an infinity was met
  bool drifted = false;              // without products the residual went astray
};

// Vectors of one run, kept by the caller so that the next one finds its memory in place.
struct PcgVectors {
  Buffer<double> r, p, q;
  Buffer<float> r_f, z;
};

// x: warm start in, solution out. A column with b = 0 gives x = 0 and residual 0.
template <int K>
PcgResult<K> pcg(const PcgSystem<K>& system, const double* b, double* x, PcgVectors& vectors,
                 const SolveOptions& options, const Poll& poll);

extern template PcgResult<1> pcg<1>(const PcgSystem<1>&, const double*, double*, PcgVectors&,
                                    const SolveOptions&, const Poll&);
extern template PcgResult<2> pcg<2>(const PcgSystem<2>&, const double*, double*, PcgVectors&,
                                    const SolveOptions&, const Poll&);
extern template PcgResult<4> pcg<4>(const PcgSystem<4>&, const double*, double*, PcgVectors&,
                                    const SolveOptions&, const Poll&);

}  // namespace stretchmap::linalg
