#include "linalg/iterative.hpp"

#include <cmath>
#include <utility>

namespace stretchmap::linalg {

using std::size_t;

// A relative residual that rounding in single precision is far from, even where it counts as often
// as coarse corrections are larger than residuals.
constexpr double kLoose = 1e-2;

template <int B, int M>
IterativeSolver<B, M>::IterativeSolver(Index n, const Index* start, const Index* col,
                                       std::vector<double> modes, std::vector<Index> order)
    : matrix_{n, start, col}, order_(std::move(order)) {
  multigrid_.finest().set_pattern(n, start, col, order_);
  if (order_.empty()) {
    modes_ = std::move(modes);
    return;
  }
  constexpr size_t kWidth = static_cast<size_t>(B) * M;
  modes_.resize(modes.size());
  for (size_t i = 0; kWidth * i < modes.size(); ++i)
    std::copy_n(modes.data() + kWidth * order_[i], kWidth, modes_.data() + kWidth * i);
}

template <int B, int M>
void IterativeSolver<B, M>::set_scale() {
  const Buffer<Index>& diagonal = multigrid_.finest().diagonal_source;
  const double largest = -least_of(matrix_.n, 0.0, [&](Index i) {
    const double* block = matrix_.value + static_cast<size_t>(B * B) * diagonal[i];
    double most = block[0];
    for (int r = 1; r < B; ++r) most = std::max(most, block[(B + 1) * r]);
    return -most;
  });
  const bool usable = largest > 0.0 && std::isfinite(largest);
  matrix_.scale = usable ? std::ldexp(1.0, -std::ilogb(largest)) : 1.0;
}

template <int B, int M>
std::vector<Index> IterativeSolver<B, M>::refactor(const double* values, bool keep) {
  matrix_.value = values;
  kept_ = keep && ready_;
  if (kept_) return {};
  set_scale();
  std::vector<Index> bad = multigrid_.finest().set_values(values, matrix_.scale);
  for (Index& row : bad) row = order_.empty() ? row : order_[row];
  if (!bad.empty() || modes_.empty()) return bad;
  if (ready_ && !watch_.worn()) {
    multigrid_.refresh();
  } else {
    multigrid_.setup(modes_);
    watch_.reset();
    ready_ = true;
  }
  return bad;
}

template <int B, int M>
template <int K>
void IterativeSolver<B, M>::precondition_in_order(const float* r, float* z) {
  if (modes_.empty())
    multigrid_.finest().template divide_by_diagonal<K>(r, z);
  else
    multigrid_.template precondition<K>(r, z);
}

template <int B, int M>
template <int K>
void IterativeSolver<B, M>::precondition(const float* r, float* z) {
  if (order_.empty()) return precondition_in_order<K>(r, z);
  constexpr size_t kRow = static_cast<size_t>(B) * K;
  renumbered_r_.resize(kRow * matrix_.n);
  renumbered_z_.resize(kRow * matrix_.n);
  for_chunks(matrix_.n, [&](Index begin, Index end) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i)
      std::copy_n(r + kRow * order_[i], kRow, renumbered_r_.data() + kRow * i);
  });
  precondition_in_order<K>(renumbered_r_.data(), renumbered_z_.data());
  for_chunks(matrix_.n, [&](Index begin, Index end) {
    for (size_t i = begin; i < static_cast<size_t>(end); ++i)
      std::copy_n(renumbered_z_.data() + kRow * i, kRow, z + kRow * order_[i]);
  });
}

template <int B, int M>
template <int K>
PcgResult<K> IterativeSolver<B, M>::solve(const double* b, double* x, Index stride, int used,
                                          const SolveOptions& options, const Poll& poll) {
  const size_t n = matrix_.n;
  // Columns scaled to moderate size, by powers of two so that nothing is rounded.
  std::array<double, K> factor;
  factor.fill(1.0);
  for (int k = 0; k < used; ++k) {
    const double largest = -least_of(matrix_.n * B, 0.0, [&](Index row) {
      return -std::abs(b[static_cast<size_t>(stride) * row + k]);
    });
    if (largest > 0.0 && std::isfinite(largest)) factor[k] = std::ldexp(1.0, -std::ilogb(largest));
  }
  inner_b_.resize(n * B * K);
  inner_x_.resize(n * B * K);
  // visit(entry of the inner vectors, of the caller's, factor) for all that are used.
  const auto each = [&](const auto& visit) {
    for_chunks(matrix_.n, [&](Index begin, Index end) {
      for (size_t row = static_cast<size_t>(B) * begin; row < static_cast<size_t>(B) * end; ++row)
        for (int k = 0; k < used; ++k) visit(K * row + k, stride * row + k, factor[k]);
    });
  };
  for_chunks(used < K ? matrix_.n : 0, [&](Index begin, Index end) {
    constexpr size_t kRow = static_cast<size_t>(B) * K;
    std::fill(inner_b_.data() + kRow * begin, inner_b_.data() + kRow * end, 0.0);
    std::fill(inner_x_.data() + kRow * begin, inner_x_.data() + kRow * end, 0.0);
  });
  each([&](size_t in, size_t out, double f) {
    inner_b_[in] = f * b[out];
    inner_x_[in] = f / matrix_.scale * x[out];
  });
  PcgSystem<K> system{
      static_cast<Index>(n) * B,
      [&](const double* p, double* q) { return matrix_.template multiply<K>(p, q); },
      [&](const float* r, float* z) { precondition<K>(r, z); },
      {}};
  if constexpr (B == 3)
    if (order_.empty() && !modes_.empty() && !kept_ && !stiff_ && options.tol >= kLoose)
      system.unbalanced = [&](const float* z, float* change) { multigrid_.unbalanced(z, change); };
  const PcgResult<K> result =
      pcg<K>(system, inner_b_.data(), inner_x_.data(), vectors_, options, poll);
  if (result.finite)
    each([&](size_t in, size_t out, double f) { x[out] = matrix_.scale / f * inner_x_[in]; });
  stiff_ = stiff_ || result.drifted;
  if (!kept_) watch_.observe(result.iterations, result.digits);
  if (result.negative_curvature || !result.finite) watch_.fail();
  return result;
}

template class IterativeSolver<1, 1>;
template PcgResult<1> IterativeSolver<1, 1>::solve<1>(const double*, double*, Index, int,
                                                      const SolveOptions&, const Poll&);
template PcgResult<2> IterativeSolver<1, 1>::solve<2>(const double*, double*, Index, int,
                                                      const SolveOptions&, const Poll&);
template PcgResult<4> IterativeSolver<1, 1>::solve<4>(const double*, double*, Index, int,
                                                      const SolveOptions&, const Poll&);
template class IterativeSolver<3, 3>;
template PcgResult<1> IterativeSolver<3, 3>::solve<1>(const double*, double*, Index, int,
                                                      const SolveOptions&, const Poll&);
template class IterativeSolver<3, 6>;
template PcgResult<1> IterativeSolver<3, 6>::solve<1>(const double*, double*, Index, int,
                                                      const SolveOptions&, const Poll&);

}  // namespace stretchmap::linalg
