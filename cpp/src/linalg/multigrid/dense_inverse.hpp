// The inverse of the coarsest matrix.
#pragma once

#include <vector>

#include "stretchmap/linalg/pattern.hpp"

namespace stretchmap::linalg {

// The coarsest matrix, inverted.
class DenseInverse {
 public:
  // The matrix in compressed rows with blocks of `block` unknowns; a matrix that is not positive
  // definite is replaced by the one with the absolute values of its eigenvalues.
  void set(const Pattern& pattern, const Buffer<double>& values, int block);
  // x = inverse times b for N = 1, 2 or 4 interleaved columns; zero where there is no inverse.
  template <int N>
  void apply(const float* b, float* x) const;

 private:
  Index n_ = 0;
  std::vector<float> inverse_;
};

}  // namespace stretchmap::linalg
