// Cutting a tet mesh along a level set of a function that is linear on every tet.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::partitions {

struct TetSplit {
  Tets tets;        // (k') positively oriented if the input was; no tet crosses the level
  IndexVec side;    // (k') -1 or 1, the sign of the function in the tet
  IndexVec parent;  // (k') input tet of each tet, ascending
  Edges cut_edges;  // (c, 2) new vertex n + i lies on this edge, lower id first,
  Vec cut_weight;   // (c) at (1 - w) first + w second
};

// Cuts every tet along values = 0. Neighbors agree on the new vertices and on the diagonals of cut
// faces, so the result is conforming and either side has a closed boundary.
// \param values (n) A vertex closer to the level than 1e-9 of one of its edges is taken to lie on
// it. \param gate (n) or empty: only the part of the level where it is positive is cut; a tet that
// the
//        rest would cut stays whole and gets the sign of its largest value.
// \pre with a gate: no tet crosses the level on both sides of the gate.
TetSplit split_tets(const TetsRef& tets, const VecRef& values, const VecRef& gate);

// \param volumes (k) of the tets.
// \param values (n) of a function that is linear on every tet.
// \return the volume where it is negative.
double volume_below(const TetsRef& tets, const VecRef& volumes, const VecRef& values);

}  // namespace stretchmap::partitions
