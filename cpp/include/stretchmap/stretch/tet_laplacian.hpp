// Volumetric Laplacians of a tetrahedral mesh with a prescribed boundary, on a pattern built once.
//
// With g_i the outward area vector of the face opposite vertex i, the entry (i, j) of a tet is
// coef * g_i . g_j, where
//   coef = 1 / (9 |tau|) and the g of the source give L_D of (5.7)-(5.8), the P1 stiffness matrix;
//   coef = 1 / (9 (|tau| + c |f(tau)|)) and the g of the image give L_S(f) of (5.2)-(5.6),
// since g_i . g_j = -|f_i| |f_j| cos(theta). The image volume of (5.3) cancels against the stretch
// factor, so for c = 0 the matrix is polynomial in f and never singular.
//
// Assembly is a gather: each matrix row sums its own tets in a fixed order, so the values do not
// depend on the number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap {

using Flags = Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>;
using FlagsRef = Eigen::Ref<const Flags>;

class TetLaplacian {
 public:
  // fixed[i] != 0 marks vertices whose position is prescribed (the set B of Algorithm 5.1).
  // \pre tets index into [0, fixed.size()).
  TetLaplacian(const TetsRef& tets, const FlagsRef& fixed);

  // A matrix with the pattern of L_II, to be owned by a solver, values unset.
  SparseMatrix pattern() const;

  // Writes L_II into the values of `matrix` and -L_IB x_B into `rhs`, L being the Laplacian with
  // the area vectors of `geometry` (n, 3) and the factors `coef` (k). `x` (n, 3) supplies x_B. \pre
  // matrix has the pattern of pattern().
  void assemble(const PointsRef& geometry, const VecRef& coef, const PointsRef& x,
                SparseMatrix& matrix, Points& rhs);

  const IndexVec& interior() const { return interior_; }  // vertex of each matrix row

 private:
  void build_edges();
  void build_rows(const FlagsRef& fixed);

  Tets tets_;
  Index n_vertices_;
  Edges edges_;  // only while the pattern is built
  IndexVec interior_;
  std::vector<Index> outer_, inner_;  // the matrix pattern
  std::vector<Index> diagonal_;       // position of each row's diagonal entry
  std::vector<Index> edge_start_;     // per edge, its slots (6 * tet + local edge)
  std::vector<Index> edge_slot_;
  std::vector<Index> entry_edge_;    // per matrix entry its edge, -1 on the diagonal
  std::vector<Index> couple_start_;  // per row, its prescribed neighbours
  std::vector<Index> couple_edge_;
  std::vector<Index> couple_vertex_;
  std::vector<double> slot_weight_;  // scratch kept between calls
  std::vector<double> edge_weight_;
};

// Signed volumes (k) of the tets with vertex positions x (n, 3).
Vec signed_tet_volumes(const PointsRef& x, const TetsRef& tets);

// Volumetric stretch energy (5.1) at c = 0, 3/2 sum |f(tau)|^2 / |tau|; rest volumes positive.
double tet_stretch_energy(const VecRef& image_volumes, const VecRef& rest_volumes);

// Gradient (n, 3) of tet_stretch_energy with respect to the image, 3 L_S(f) f.
Points tet_stretch_gradient(const PointsRef& image, const TetsRef& tets,
                            const VecRef& rest_volumes);

}  // namespace stretchmap
