// Harmonic 1-forms of a weighted graph of edges: (3.3)-(3.5) for many classes at once.
#pragma once

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::forms {

struct HarmonicSolution {
  Rows forms;       // (k, e) eta + d potential
  Rows potentials;  // (n, k) column l belongs to form l, zero at vertex 0
  Rows gram;        // (k, k) sum over edges of weight * form_i * form_j
};

// Solves sum_j w_ij (eta([i, j]) + h_j - h_i) = 0 for every row of `eta` (k, e): the Laplacian
// with vertex 0 pinned, factorized or, if large, preconditioned by multigrid, k right-hand sides.
// Forms run along `edges` from the first to the second vertex.
// \pre    connected graph, eta closed on the surface, weights (e) with a positive definite pinned
//         Laplacian.
// \throws Error "SolverError" when the factorization breaks down.
HarmonicSolution harmonic_forms(Index n_vertices, const EdgesRef& edges, const VecRef& weights,
                                const RowsRef& eta);

}  // namespace stretchmap::forms
