// Edges of a surface halved, with the faces beside them.
#pragma once

#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::mesh {

struct HalvedFaces {
  Edges ends;       // (a, 2) of the edges halved, in their order
  Faces faces;      // (m', 3) in vertices and, from n on, midpoints of those edges
  IndexVec parent;  // (m') face each is a part of, ascending
  Faces slots;      // (m', 3) what of that face each corner is: 0, 1, 2 its corners, 3, 4, 5 the
                    //     midpoints of the edges that begin there
};

// \param marked (e) edges to be halved; with them is the longest of every face that has one of them
//        (M.-C. Rivara, Int. J. Numer. Methods Eng. 20(4), 1984).
// \param lengths (e) by which one edge is longer than another, and the diagonal to its middle
//        shorter.
// \throws Error "ArrayError" for another number of edges.
HalvedFaces halve_edges(const SurfaceTopology& top, const FlagsRef& marked, const VecRef& lengths);

}  // namespace stretchmap::mesh
