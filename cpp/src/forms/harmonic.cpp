#include "stretchmap/forms/harmonic.hpp"

#include <algorithm>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/linalg/block_ldlt.hpp"
#include "stretchmap/linalg/spd_solver.hpp"
#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::forms {
namespace {

using linalg::SpdSolver;

constexpr Index kLarge = 50000;  // rows from which multigrid is faster than a factorization
constexpr double kTol = 1e-12;

// The Laplacian without row and column 0.
SparseMatrix pinned_laplacian(Index n, const EdgesRef& edges, const VecRef& weights) {
  std::vector<Eigen::Triplet<double, Index>> entries;
  entries.reserve(2 * weights.size() + n);
  Vec diagonal = Vec::Zero(n);
  for (Index e = 0; e < weights.size(); ++e) {
    const Index i = edges(e, 0), j = edges(e, 1);
    if (i == j) continue;
    diagonal[i] += weights[e];
    diagonal[j] += weights[e];
    if (i == 0 || j == 0) continue;
    entries.emplace_back(j - 1, i - 1, -weights[e]);
    entries.emplace_back(i - 1, j - 1, -weights[e]);
  }
  for (Index i = 1; i < n; ++i) entries.emplace_back(i - 1, i - 1, diagonal[i]);
  SparseMatrix matrix(n - 1, n - 1);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

Rows solved_directly(const SparseMatrix& A, Rows b) {
  linalg::BlockLdlt<1> factor(A);
  try {
    factor.factorize(A);
  } catch (const Error&) {
    throw Error("SolverError",
                "the surface Laplacian could not be factorized; look for degenerate faces with "
                "diagnose()");
  }
  for (Index c = 0; c < b.cols(); ++c) b.col(c) = factor.solve(Vec(b.col(c)));
  return b;
}

// Large systems by multigrid, unless weights that differ too much keep it from converging.
Rows solved(const SparseMatrix& A, const Rows& b) {
  if (A.rows() < kLarge) return solved_directly(A, b);
  try {
    linalg::SolveOptions options;
    options.tol = kTol;
    Rows x = Rows::Zero(b.rows(), b.cols());
    SpdSolver(SparseMatrix(A), {"multigrid"}).solve(b, x, options);
    return x;
  } catch (const Error&) {
    return solved_directly(A, b);
  }
}

}  // namespace

HarmonicSolution harmonic_forms(Index n_vertices, const EdgesRef& edges, const VecRef& weights,
                                const RowsRef& eta) {
  const Index n_edges = static_cast<Index>(edges.rows());
  Rows divergence = Rows::Zero(n_vertices, eta.rows());
  for (Index e = 0; e < n_edges; ++e) {
    divergence.row(edges(e, 0)) += weights[e] * eta.col(e).transpose();
    divergence.row(edges(e, 1)) -= weights[e] * eta.col(e).transpose();
  }
  HarmonicSolution result;
  result.potentials.setZero(n_vertices, eta.rows());
  result.potentials.bottomRows(n_vertices - 1) =
      solved(pinned_laplacian(n_vertices, edges, weights), divergence.bottomRows(n_vertices - 1));
  if (!result.potentials.allFinite()) {
    throw Error("SolverError",
                "the harmonic forms are not finite; look for degenerate faces with diagnose()");
  }
  result.forms = eta;
  for (Index e = 0; e < n_edges; ++e) {
    result.forms.col(e) +=
        (result.potentials.row(edges(e, 1)) - result.potentials.row(edges(e, 0))).transpose();
  }
  result.gram = linalg::weighted_gram(result.forms, weights);
  return result;
}

}  // namespace stretchmap::forms
