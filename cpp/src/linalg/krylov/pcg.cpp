#include "linalg/krylov/pcg.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {
namespace {

// Squares of what a residual may grow by, and of what is small against the goal.
constexpr double kDrift = 1.2, kNear = 0.01;

template <int K>
using Scalars = std::array<double, K>;

template <int K, class Real>
Scalars<K> dots(Index n, const double* a, const Real* b) {
  return sum_chunks<K>(n, [&](Index begin, Index end, Scalars<K>& sums) {
    for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
      for (int k = 0; k < K; ++k) sums[k] += a[K * i + k] * b[K * i + k];
  });
}

template <int K>
void set_zero(Index n, double* to) {
  for_chunks(n, [&](Index begin, Index end) {
    std::fill(to + std::size_t(K) * begin, to + std::size_t(K) * end, 0.0);
  });
}

// r = b - q, in both precisions; returns |r|^2.
template <int K>
Scalars<K> residual_from(Index n, const double* b, const double* q, double* r, float* r_f) {
  return sum_chunks<K>(n, [&](Index begin, Index end, Scalars<K>& sums) {
    for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
      for (int k = 0; k < K; ++k) {
        const double value = b[K * i + k] - q[K * i + k];
        r[K * i + k] = value;
        r_f[K * i + k] = static_cast<float>(value);
        sums[k] += value * value;
      }
  });
}

// x += alpha p, r -= alpha q, returns |r|^2.
template <int K>
Scalars<K> advance(Index n, const Scalars<K>& alpha, const double* p, const double* q, double* x,
                   double* r, float* r_f) {
  return sum_chunks<K>(n, [&](Index begin, Index end, Scalars<K>& sums) {
    for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
      for (int k = 0; k < K; ++k) {
        x[K * i + k] += alpha[k] * p[K * i + k];
        const double value = r[K * i + k] - alpha[k] * q[K * i + k];
        r[K * i + k] = value;
        r_f[K * i + k] = static_cast<float>(value);
        sums[k] += value * value;
      }
  });
}

// p = z + beta p
template <int K>
void turn(Index n, const Scalars<K>& beta, const float* z, double* p) {
  for_chunks(n, [&](Index begin, Index end) {
    for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
      for (int k = 0; k < K; ++k) p[K * i + k] = z[K * i + k] + beta[k] * p[K * i + k];
  });
}

// p = z + beta p, q = r + change + beta q; returns p'q.
template <int K>
Scalars<K> turn_both(Index n, const Scalars<K>& beta, const float* z, const double* r,
                     const float* change, double* p, double* q) {
  return sum_chunks<K>(n, [&](Index begin, Index end, Scalars<K>& sums) {
    for (std::size_t i = begin; i < static_cast<std::size_t>(end); ++i)
      for (int k = 0; k < K; ++k) {
        const double direction = z[K * i + k] + beta[k] * p[K * i + k];
        const double product = r[K * i + k] + change[K * i + k] + beta[k] * q[K * i + k];
        p[K * i + k] = direction;
        q[K * i + k] = product;
        sums[k] += direction * product;
      }
  });
}

template <int K>
bool all_finite(const Scalars<K>& values) {
  for (double value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

// What one run of conjugate gradients needs to go on.
template <int K>
struct Run {
  const PcgSystem<K>& system;
  const double* b;
  double* x;
  Buffer<double>&r, &p, &q;
  Buffer<float>&r_f, &z;
  double energy_share;
  Scalars<K> goal{};  // squared residual aimed at
  Scalars<K> rr{};
  Scalars<K> gained{};  // twice what all steps lowered the quadratic by
  // What the last did, or was promised by the preconditioner: where that is poor, single stiff rows
  // shorten steps that all others wait for, and little gained tells nothing.
  Scalars<K> last{};
  PcgResult<K> result{};

  // Whether they are made, or what replaces them does.
  bool products() const { return !system.unbalanced || result.drifted; }

  bool done(int k) const {
    if (!(rr[k] <= goal[k])) return false;
    return energy_share <= 0.0 || rr[k] == 0.0 ||
           (gained[k] > 0.0 && result.iterations * last[k] <= energy_share * gained[k]);
  }

  bool reached() const {
    for (int k = 0; k < K; ++k)
      if (!done(k)) return false;
    return true;
  }

  // Of a start at zero it needs no product.
  void first_residual() {
    if (std::any_of(x, x + static_cast<std::size_t>(K) * system.n,
                    [](double v) { return v != 0.0; }))
      return true_residual();
    set_zero<K>(system.n, q.data());
    rr = residual_from<K>(system.n, b, q.data(), r.data(), r_f.data());
    result.finite = result.finite && all_finite<K>(rr);
  }

  void true_residual() {
    system.apply(x, q.data());
    rr = residual_from<K>(system.n, b, q.data(), r.data(), r_f.data());
    result.finite = result.finite && all_finite<K>(rr);
  }

  // The residual made anew. Where rounding in what replaces products has shifted it, they are made
  // from here on.
  void checked_residual() {
    const Scalars<K> told = rr;
    true_residual();
    for (int k = 0; k < K && !products(); ++k)
      result.drifted = rr[k] > std::max(kDrift * told[k], kNear * goal[k]);
  }

  // The goals; columns without a right-hand side are zero.
  void begin(const Scalars<K>& bb, double tol) {
    for (int k = 0; k < K; ++k) {
      goal[k] = tol * tol * bb[k];
      for (Index i = 0; bb[k] == 0.0 && i < system.n; ++i)
        x[static_cast<std::size_t>(K) * i + k] = 0.0;
    }
  }

  // p = z + beta p, with what keeps the directions conjugate, and q = A p; returns p'q.
  Scalars<K> turn_direction(const Scalars<K>& rz, const Scalars<K>& rz_old) {
    Scalars<K> beta{};
    for (int k = 0; k < K; ++k) beta[k] = rz_old[k] == 0.0 ? 0.0 : rz[k] / rz_old[k];
    if (products()) {
      turn<K>(system.n, beta, z.data(), p.data());
      return system.apply(p.data(), q.data());
    }
    system.unbalanced(z.data(), r_f.data());  // whose numbers are made anew with the next residual
    return turn_both<K>(system.n, beta, z.data(), r.data(), r_f.data(), p.data(), q.data());
  }

  // Steps until the recursive residual is at the goal, the budget is spent or something breaks.
  void iterate(int max_iter, const Poll& poll) {
    Scalars<K> rz_old{};  // zero: the first direction is the preconditioned residual
    const Index n = system.n;
    while (result.iterations < max_iter && !reached()) {
      if (poll) poll();
      system.precondition(r_f.data(), z.data());
      const Scalars<K> rz = dots<K>(n, r.data(), z.data());
      if (!(result.finite = all_finite<K>(rz))) return;
      const Scalars<K> pq = turn_direction(rz, rz_old);
      if (!(result.finite = all_finite<K>(pq))) return;
      Scalars<K> alpha{};
      for (int k = 0; k < K; ++k) {
        if (done(k)) continue;  // this column rests
        if (pq[k] <= 0.0 || rz[k] <= 0.0) {
          result.negative_curvature = true;
          alpha = {};
          // At the very first step there is no iterate to keep: the preconditioned gradient.
          if (result.iterations == 0 && rz[k] > 0.0) alpha[k] = 1.0;
          advance<K>(n, alpha, p.data(), q.data(), x, r.data(), r_f.data());
          return;
        }
        alpha[k] = rz[k] / pq[k];
        last[k] = std::max(alpha[k], 1.0) * rz[k];
        gained[k] += alpha[k] * rz[k];
      }
      rr = advance<K>(n, alpha, p.data(), q.data(), x, r.data(), r_f.data());
      if (!(result.finite = all_finite<K>(rr))) return;
      rz_old = rz;
      ++result.iterations;
    }
  }
};

}  // namespace

template <int K>
PcgResult<K> pcg(const PcgSystem<K>& system, const double* b, double* x, PcgVectors& vectors,
                 const SolveOptions& options, const Poll& poll) {
  const Index n = system.n;
  const std::size_t size = static_cast<std::size_t>(n) * K;
  const Scalars<K> bb = dots<K>(n, b, b);
  Run<K> run{system,    b,           x,         vectors.r,           vectors.p,
             vectors.q, vectors.r_f, vectors.z, options.energy_share};
  for (Buffer<double>* vector : {&run.r, &run.p, &run.q}) vector->resize(size);
  for (Buffer<float>* vector : {&run.r_f, &run.z}) vector->resize(size);
  set_zero<K>(n, run.p.data());
  if (!(run.result.finite = all_finite<K>(bb))) return run.result;
  run.begin(bb, options.tol);
  // The recursive residual drifts from the true one; a restart from the true one closes the gap.
  run.first_residual();
  const Scalars<K> first = run.rr;
  for (int restart = 0; restart < 4 && run.result.finite && !run.reached(); ++restart) {
    const int before = run.result.iterations;
    run.iterate(options.max_iter, poll);
    if (!run.result.finite) break;
    run.checked_residual();
    if (run.result.negative_curvature || run.result.iterations == before) break;
  }
  run.result.digits = std::numeric_limits<double>::max();
  for (int k = 0; k < K; ++k) {
    run.result.residual[k] = bb[k] > 0.0 ? std::sqrt(run.rr[k] / bb[k]) : 0.0;
    if (first[k] > run.goal[k] && run.rr[k] > 0.0)
      run.result.digits = std::min(run.result.digits, 0.5 * std::log10(first[k] / run.rr[k]));
  }
  return run.result;
}

template PcgResult<1> pcg<1>(const PcgSystem<1>&, const double*, double*, PcgVectors&,
                             const SolveOptions&, const Poll&);
template PcgResult<2> pcg<2>(const PcgSystem<2>&, const double*, double*, PcgVectors&,
                             const SolveOptions&, const Poll&);
template PcgResult<4> pcg<4>(const PcgSystem<4>&, const double*, double*, PcgVectors&,
                             const SolveOptions&, const Poll&);

}  // namespace stretchmap::linalg
