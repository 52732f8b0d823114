// Minimum degree: what has the fewest neighbors left is eliminated first. Where a surface is much
// finer here than there, and vertices differ much in their number of neighbors, its factor has far
// fewer entries than what nested dissection by distances leaves.
#pragma once

#include "linalg/direct/nested_dissection.hpp"

namespace stretchmap::linalg {

struct MinimumDegree {
  Dissection tree;     // a node: vertices eliminated together, of which nearly all fill the same
  double flops = 0.0;  // of the dense fronts
};

// \param start, col compressed rows of a symmetric pattern of n vertices.
// \param width unknowns per vertex.
MinimumDegree minimum_degree(Index n, const Index* start, const Index* col, Index width);

}  // namespace stretchmap::linalg
