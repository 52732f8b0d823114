// The inner loop of TetLaplacian: cotangent weights of tets, added to one sum per edge.
#pragma once

#include <cstdint>

namespace stretchmap::volume {

inline constexpr int kTetGroup = 8;  // tets that may be treated at once

struct TetWeightsTask {
  const double* x;              // 4 numbers per vertex, the last one zero
  const std::int32_t* corners;  // 4 per tet
  const double* rest;           // volume per tet
  const std::int32_t* slots;    // 6 per tet, the sums of edges 01, 02, 03, 12, 13, 23
  std::int64_t count;           // tets, a multiple of kTetGroup
  double c;                     // regularization (5.6)
  double* sums;                 // sums[slot] += g_i . g_j / (9 (rest + c |volume|))
};

using TetWeightsKernel = void (*)(const TetWeightsTask&);

// The kernel with the most lanes, at most `max_lanes` (8, 4, 1), that was built and that this
// processor can run. All kernels give the same bits.
TetWeightsKernel tet_weights_kernel(int max_lanes);

// Null where the compiler or the processor kind has no such instructions.
TetWeightsKernel tet_weights_avx2();
TetWeightsKernel tet_weights_avx512();

}  // namespace stretchmap::volume
