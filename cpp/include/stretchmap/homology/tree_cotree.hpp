// Homology generators of a closed surface and the integer 1-forms dual to them.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::homology {

using Loop = std::vector<Index>;  // vertex ids, the first not repeated at the end

struct HomologyGenerators {
  std::vector<Loop> loops;  // 2g simple loops, a basis of H1 over the integers
  IndexRows forms;          // (2g, e) integer closed 1-forms; the period of form i over loop j is
                            //   exactly delta_ij, so they play the part of (3.1)
};

// Tree-cotree decomposition: a shortest-path tree of the edge graph from vertex 0, and a dual
// spanning tree that avoids it and keeps out the edges that close the shortest loops. The 2g edges
// in neither tree close one primal and one dual loop each; the signed crossings of the dual loops
// are the forms.
// \pre    closed, oriented surface without unreferenced vertices; edge_length (e) positive.
// \throws Error "ConnectivityError" when the surface has more than one component.
HomologyGenerators tree_cotree(const mesh::SurfaceTopology& top, const VecRef& edge_length);

// \return the half-edge from vertex i to vertex j, -1 when there is no such edge.
// \pre the surface is closed.
Index find_halfedge(const mesh::SurfaceTopology& top, Index i, Index j);

// The half-edges along a loop; entry k leaves loop[k].
// \throws Error "ArrayError" when two consecutive vertices are not joined by an edge.
std::vector<Index> loop_halfedges(const mesh::SurfaceTopology& top, const Loop& loop);

// \param forms (k, e) integer 1-forms.
// \return (k) their integrals along a loop.
IndexVec periods(const mesh::SurfaceTopology& top, const Eigen::Ref<const IndexRows>& forms,
                 const Loop& loop);

// \param forms (k, e)
// \return (k, k) integrals of form_i ^ form_j over the surface: on a face with corners 0, 1, 2 it
// is
//         (a01 b12 - a12 b01) / 2. Antisymmetric, integer for integer closed forms.
Rows wedge_matrix(const mesh::SurfaceTopology& top, const RowsRef& forms);

}  // namespace stretchmap::homology
