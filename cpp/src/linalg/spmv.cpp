#include "spmv.hpp"

#include "parallel.hpp"

namespace stretchmap::linalg {

template <int K>
void multiply(const SparseMatrix& A, const double* x, double* y) {
  const Index* start = A.outerIndexPtr();
  const Index* col = A.innerIndexPtr();
  const double* value = A.valuePtr();
  for_chunks(static_cast<Index>(A.rows()), [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      double sum[K] = {};
      for (Index e = start[i]; e < start[i + 1]; ++e) {
        const double* xe = x + static_cast<std::size_t>(K) * col[e];
        for (int k = 0; k < K; ++k) sum[k] += value[e] * xe[k];
      }
      for (int k = 0; k < K; ++k) y[static_cast<std::size_t>(K) * i + k] = sum[k];
    }
  });
}

template void multiply<1>(const SparseMatrix&, const double*, double*);
template void multiply<2>(const SparseMatrix&, const double*, double*);
template void multiply<4>(const SparseMatrix&, const double*, double*);

void multiply(const BlockMatrix& A, const double* x, double* y) {
  const Index* start = A.row_ptr.data();
  for_chunks(A.rows(), [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      double sum[3] = {};
      for (Index e = start[i]; e < start[i + 1]; ++e) {
        const double* a = A.values.data() + 9 * static_cast<std::size_t>(e);
        const double* xe = x + 3 * static_cast<std::size_t>(A.col[e]);
        for (int r = 0; r < 3; ++r)
          sum[r] += a[3 * r] * xe[0] + a[3 * r + 1] * xe[1] + a[3 * r + 2] * xe[2];
      }
      for (int r = 0; r < 3; ++r) y[3 * static_cast<std::size_t>(i) + r] = sum[r];
    }
  });
}

}  // namespace stretchmap::linalg
