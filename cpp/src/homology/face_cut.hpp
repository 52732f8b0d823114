// Minimum cuts of the dual graph of a surface.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::homology {

// Which faces f to take, so that the supply of those left out, less the demand of those taken, and
// the capacity of the edges between the two kinds are least together. A maximal flow in Dinic's
// layers; every step saturates something exactly, so that rounding cannot keep it going.
// \param capacity (3m) of half-edges, both of an edge alike. \param supply (m) demands negative.
// \return (m) the faces that spare supply reaches: the smallest of the best choices.
std::vector<char> least_cut(const mesh::SurfaceTopology& top, Vec capacity, Vec supply,
                            const Poll& poll);

}  // namespace stretchmap::homology
