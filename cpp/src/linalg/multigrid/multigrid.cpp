#include "linalg/multigrid/multigrid.hpp"

#include <cmath>

namespace stretchmap::linalg {
namespace {

using std::size_t;

constexpr Index kCoarsest = 150;  // unknowns that are inverted densely
constexpr double kThreshold = 0.1;
constexpr int kPowerSteps = 12;

}  // namespace

template <int B, int K>
double Level<B, K>::damping() const {
  // The filtered matrix has no positive off-diagonal entry: its scaled spectrum ends below 2.
  if constexpr (B == 1) return 0.75;
  // The largest eigenvalue of D^-1 A by the power method, a little enlarged.
  const size_t size = static_cast<size_t>(B) * A.n;
  std::vector<float> probe(size), image(size);
  std::uint32_t state = 1;
  for (float& value : probe) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state >> 8) / (1u << 24) - 0.5f;
  }
  double eigenvalue = 1.0;
  for (int step = 0; step < kPowerSteps; ++step) {
    const auto norm = [&](const std::vector<float>& v) {
      return std::sqrt(sum_chunks<1>(static_cast<Index>(size),
                                     [&](Index begin, Index end, std::array<double, 1>& sum) {
                                       for (Index i = begin; i < end; ++i)
                                         sum[0] += static_cast<double>(v[i]) * v[i];
                                     })[0]);
    };
    A.scaled_multiply(probe.data(), image.data());
    const double before = norm(probe), after = norm(image);
    if (!(before > 0.0 && after > 0.0)) break;
    eigenvalue = after / before;
    const float scale = static_cast<float>(1.0 / after);
    for (size_t i = 0; i < size; ++i) probe[i] = scale * image[i];
  }
  return 4.0 / 3.0 / std::max(1.0, 1.05 * eigenvalue);
}

template <int B, int K>
template <int N>
void Level<B, K>::descend(const float* right_hand_side, std::vector<float>& coarse_b) {
  const size_t size = static_cast<size_t>(B) * N * A.n;
  smooth.resize(size);
  work.resize(size);
  coarse_b.resize(static_cast<size_t>(K) * N * transfer.coarse.rows());
  A.template sweep_forward<N>(right_hand_side, smooth.data(), work.data());
  transfer.template restrict_to<N>(work.data(), coarse_b.data());
}

template <int B, int K>
template <int N>
void Level<B, K>::ascend(const float* right_hand_side, const std::vector<float>& coarse_x,
                         float* out) {
  transfer.template prolong_add<N>(coarse_x.data(), smooth.data(), work.data());
  A.template sweep_backward<N>(right_hand_side, work.data(), out);
}

template <int B, int K>
void Multigrid<B, K>::setup(const std::vector<double>& modes) {
  coarse_.clear();
  std::vector<double> next_modes =
      finest_.transfer.setup(finest_.A, modes, kThreshold, finest_.damping());
  Buffer<double> values = finest_.transfer.coarse_values(finest_.A);
  Index fine_rows = finest_.A.n;
  const Pattern* pattern = &finest_.transfer.coarse;
  while (pattern->rows() * K > kCoarsest && pattern->rows() < 0.8 * fine_rows) {
    fine_rows = pattern->rows();
    Level<K, K> level;
    level.A.set_pattern(fine_rows, pattern->start.data(), pattern->col.data(), {});
    level.A.set_values(values.data());
    next_modes = level.transfer.setup(level.A, next_modes, kThreshold, level.damping());
    values = level.transfer.coarse_values(level.A);
    coarse_.push_back(std::move(level));
    pattern = &coarse_.back().transfer.coarse;
  }
  last_pattern_ = *pattern;
  last_.set(last_pattern_, values, K);
}

template <int B, int K>
void Multigrid<B, K>::refresh() {
  Buffer<double> values = finest_.transfer.coarse_values(finest_.A);
  for (Level<K, K>& level : coarse_) {
    level.A.set_values(values.data());
    values = level.transfer.coarse_values(level.A);
  }
  last_.set(last_pattern_, values, K);
}

template <int B, int K>
template <int N>
void Multigrid<B, K>::precondition(const float* r, float* z) {
  const auto right_hand_side = [&](size_t level) -> std::vector<float>& {
    return level < coarse_.size() ? coarse_[level].b : last_b_;
  };
  finest_.template descend<N>(r, right_hand_side(0));
  for (size_t level = 0; level < coarse_.size(); ++level)
    coarse_[level].template descend<N>(coarse_[level].b.data(), right_hand_side(level + 1));
  last_x_.resize(last_b_.size());
  last_.apply<N>(last_b_.data(), last_x_.data());
  const std::vector<float>* below = &last_x_;
  for (size_t level = coarse_.size(); level-- > 0; below = &coarse_[level].x) {
    coarse_[level].x.resize(coarse_[level].b.size());
    coarse_[level].template ascend<N>(coarse_[level].b.data(), *below, coarse_[level].x.data());
  }
  finest_.template ascend<N>(r, *below, z);
}

template <int B, int K>
void Multigrid<B, K>::unbalanced(const float* z, float* change) {
  float* step = finest_.work.data();  // before the last sweep
  for_chunks(finest_.A.n * B, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) step[i] = z[i] - step[i];
  });
  finest_.A.unbalanced(step, change);
}

template class Multigrid<1, 1>;
template void Multigrid<1, 1>::precondition<1>(const float*, float*);
template void Multigrid<1, 1>::precondition<2>(const float*, float*);
template void Multigrid<1, 1>::precondition<4>(const float*, float*);
template class Multigrid<3, 3>;
template void Multigrid<3, 3>::precondition<1>(const float*, float*);
template class Multigrid<3, 6>;
template void Multigrid<3, 6>::precondition<1>(const float*, float*);

}  // namespace stretchmap::linalg
