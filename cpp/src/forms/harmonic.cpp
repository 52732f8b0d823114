#include "stretchmap/forms/harmonic.hpp"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <vector>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::forms {
namespace {

// Lower triangle of the Laplacian without row and column 0.
Eigen::SparseMatrix<double> pinned_laplacian(Index n, const EdgesRef& edges,
                                             const VecRef& weights) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(weights.size() + n);
  Vec diagonal = Vec::Zero(n);
  for (Index e = 0; e < weights.size(); ++e) {
    const Index i = std::min(edges(e, 0), edges(e, 1)), j = std::max(edges(e, 0), edges(e, 1));
    if (i == j) continue;
    diagonal[i] += weights[e];
    diagonal[j] += weights[e];
    if (i > 0) entries.emplace_back(j - 1, i - 1, -weights[e]);
  }
  for (Index i = 1; i < n; ++i) entries.emplace_back(i - 1, i - 1, diagonal[i]);
  Eigen::SparseMatrix<double> matrix(n - 1, n - 1);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace

HarmonicSolution harmonic_forms(Index n_vertices, const EdgesRef& edges, const VecRef& weights,
                                const RowsRef& eta) {
  const Index n_edges = static_cast<Index>(edges.rows());
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(
      pinned_laplacian(n_vertices, edges, weights));
  if (solver.info() != Eigen::Success) {
    throw Error("SolverError",
                "the surface Laplacian could not be factorized; look for degenerate faces with "
                "diagnose()");
  }
  Eigen::MatrixXd divergence = Eigen::MatrixXd::Zero(n_vertices, eta.rows());
  for (Index e = 0; e < n_edges; ++e) {
    divergence.row(edges(e, 0)) += weights[e] * eta.col(e).transpose();
    divergence.row(edges(e, 1)) -= weights[e] * eta.col(e).transpose();
  }
  HarmonicSolution result;
  result.potentials.setZero(n_vertices, eta.rows());
  result.potentials.bottomRows(n_vertices - 1) =
      solver.solve(divergence.bottomRows(n_vertices - 1));
  if (!result.potentials.allFinite()) {
    throw Error("SolverError",
                "the harmonic forms are not finite; look for degenerate faces with diagnose()");
  }
  result.forms = eta;
  for (Index e = 0; e < n_edges; ++e) {
    result.forms.col(e) +=
        (result.potentials.row(edges(e, 1)) - result.potentials.row(edges(e, 0))).transpose();
  }
  result.gram = result.forms * weights.asDiagonal() * result.forms.transpose();
  return result;
}

}  // namespace stretchmap::forms
