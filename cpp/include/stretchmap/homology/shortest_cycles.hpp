// Shortest integer cycle of a homology class: loops, any number of them, that make up the class.
#pragma once

#include <cstdint>
#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

using MarkRows = Eigen::Matrix<std::uint64_t, 2, Eigen::Dynamic, Eigen::RowMajor>;

// Simple loops whose classes add up to that of a sum of loops, of least total length.
//
// Cycles of one class differ by boundaries of faces, and the length is a convex function of how
// often each face is added. So it is least where no set of faces, added once, makes it less; the
// best set is a minimum cut of the dual graph (Chambers, Erickson and Nayyeri: Homology flows,
// cohomology cuts). Each of the loops is shortest in its own class, and so are those of a sum that
// hang together: no loop of a class is shorter than its shortest cycle.
// \param multiples one number for each of the loops
std::vector<Loop> shortest_cycles(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                                  const std::vector<Loop>& loops, const IndexVecRef& multiples,
                                  const Poll& poll = {});

// One closed walk along all of some loops, and to and fro along shortest paths between those that
// have no vertex in common.
Loop joined_loops(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                  const std::vector<Loop>& loops);

// Short loops of some classes: shortest paths from a root to both ends of an edge, and that edge.
// \param marks (2, e) two closed 1-forms, integers modulo 2^64. Loops count whose period over the
//              first is zero and over the second is not; of those with one period over the second,
//              or with opposite ones, the shortest.
// \param roots vertices
// \param limit of the lengths, which are below it
// \return shortest first
std::vector<Loop> tree_loops(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                             const Eigen::Ref<const MarkRows>& marks,
                             const std::vector<Index>& roots, double limit, const Poll& poll = {});

}  // namespace stretchmap::homology
