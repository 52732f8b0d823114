// Cutting a tet mesh along level sets of a function that is linear on every tet, all at once.
#pragma once

#include <limits>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap::partitions {

using Places = Eigen::Matrix<Index, Eigen::Dynamic, 4, Eigen::RowMajor>;
using PlacesRef = Eigen::Ref<const Places>;

using Corners = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;
using CornersRef = Eigen::Ref<const Corners>;

// Place of a vertex that lies on all levels at once, or where none counts.
constexpr Index kEverywhere = std::numeric_limits<Index>::min();

struct TetSplit {
  Tets tets;           // (k') positively oriented if the input was; no tet crosses a level
  IndexVec slab;       // (k') of each tet, modulo the period
  IndexVec parent;     // (k') input tet of each tet, ascending
  Edges cut_edges;     // (c, 2) new vertex n + i lies on this edge, lower id first,
  IndexVec cut_level;  // (c) where it crosses this level
};

// Cuts every tet along the levels 0, 1, ... that its places say it crosses. Slab j lies between the
// levels j - 1 and j. The pieces of a tet are its slabs, so that their number grows with that of
// the levels. Neighbors agree on the new vertices and on the diagonals of cut faces, so the result
// is conforming and every slab has a closed boundary.
// \param n_vertices new ones are numbered from here on
// \param places (k, 4) of the corners of each tet: 2 j in slab j, 2 j + 1 on level j, kEverywhere
// \param period levels that differ by a multiple of it are the same: sheets that meet in an axis
// \pre the places of an edge differ alike in all tets around it
TetSplit split_tets(const TetsRef& tets, Index n_vertices, const PlacesRef& places, Index period);

// \param values (k, 4) of a linear function at the corners of each tet.
// \return (k) the share of each where it is negative.
Vec shares_below(const CornersRef& values);

// \param volumes (k) of the tets.
// \param values (n) of a function that is linear on every tet.
// \return the volume where it is negative.
double volume_below(const TetsRef& tets, const VecRef& volumes, const VecRef& values);

}  // namespace stretchmap::partitions
