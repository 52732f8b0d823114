// Hexahedra: corners, measures, and the proof that one is valid.
//
// Corners 0..7 in the order of VTK: 0 1 2 3 round one face, 4 5 6 7 above them. A hexahedron is the
// image of the unit cube under the trilinear map x(xi, eta, zeta) of its corners; xi runs from
// corner 0 to 1, eta from 0 to 3, zeta from 0 to 4.
#pragma once

#include <array>

#include "stretchmap/base/types.hpp"

namespace stretchmap::resample {

using Hexes = Eigen::Matrix<Index, Eigen::Dynamic, 8, Eigen::RowMajor>;
using HexesRef = Eigen::Ref<const Hexes>;
using Rows8 = Eigen::Matrix<double, Eigen::Dynamic, 8, Eigen::RowMajor>;
using Rows24 = Eigen::Matrix<double, Eigen::Dynamic, 24, Eigen::RowMajor>;

// Of each corner: itself and its three neighbors, positively oriented in a right hexahedron.
inline constexpr std::array<std::array<int, 4>, 8> kCorners = {{{0, 1, 3, 4},
                                                                {1, 2, 0, 5},
                                                                {2, 3, 1, 6},
                                                                {3, 0, 2, 7},
                                                                {4, 7, 5, 0},
                                                                {5, 4, 6, 1},
                                                                {6, 5, 7, 2},
                                                                {7, 6, 4, 3}}};

// Three edges of a hexahedron, one of each direction, as the tet (x0, x1, x2, x3) whose determinant
// is theirs.
struct EdgeTriple {
  std::array<int, 4> corner{};
  std::array<int, 3> side{};  // columns of corner_sides
  int far = 0;                // the edge, 1 or 2, that starts at x1 and not at x0; 0: none
};

// First the eight corners with their own three edges, then for each of the twelve edges AB the two
// with one further edge at A and the other at B. The mean of those two determinants is the
// coefficient below in the middle of AB.
const std::array<EdgeTriple, 32>& edge_triples();

// Coefficients of det dx/d(xi, eta, zeta) in the Bernstein polynomials of degree (2, 2, 2), the one
// of B_i(xi) B_j(eta) B_k(zeta) at 9 i + 3 j + k. The determinant is between the least and the
// largest of them, and equals those with i, j, k in {0, 2} at the corners.
//
// No monomial of it has two squares, so that the 27 follow from 20 determinants: the corners' and
// two mixed ones for each of the twelve edges (Johnen, Weill, Remacle, "Robust and efficient
// validation of the linear hexahedral element", 2017).
//
// \param corner (8) points. \return (27).
std::array<double, 27> jacobian_coefficients(const std::array<Eigen::Vector3d, 8>& corner);

// Whether the Jacobian determinant is proven to be positive in the whole of each hexahedron: the
// coefficients are, or those of the parts after halving it again and again are. Each sign is
// decided against a bound of the rounding errors; a determinant positive by less than that counts
// as not positive.
//
// \param points (n, 3). \param hexes (k, 8), ids below n. \return (k) 1 for valid, else 0.
Flags valid_hexes(const PointsRef& points, const HexesRef& hexes, const Poll& poll = {});

// \return (k, 8) Jacobian at each corner over the product of the three edge lengths there; 0 where
// an
//         edge has no length.
Rows8 scaled_jacobians(const PointsRef& points, const HexesRef& hexes);

// \return (k, 24) lengths of the edges from each corner to its three neighbors in kCorners.
Rows24 corner_sides(const PointsRef& points, const HexesRef& hexes);

// \return (k) the least determinant of the last 24 edge triples over the product of their lengths.
Vec least_edge_jacobians(const PointsRef& points, const HexesRef& hexes);

// \return (k) volumes of the trilinear hexahedra.
Vec hex_volumes(const PointsRef& points, const HexesRef& hexes);

}  // namespace stretchmap::resample
