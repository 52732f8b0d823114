// Volumetric Laplacians of a tetrahedral mesh with a prescribed boundary, on a pattern built once.
//
// With g_i the outward area vector of the face opposite vertex i, the entry (i, j) of a tet is
// coef * g_i . g_j, where
//   coef = 1 / (9 |tau|) and the g of the source give L_D of (5.7)-(5.8), the P1 stiffness matrix;
//   coef = 1 / (9 (|tau| + c |f(tau)|)) and the g of the image give L_S(f) of (5.2)-(5.6),
// since g_i . g_j = -|f_i| |f_j| cos(theta). The image volume of (5.3) cancels against the stretch
// factor, so for c = 0 the matrix is polynomial in f and never singular.
//
// Assembly sums the weights of every edge in a fixed order (tet_plan.hpp), several tets at once
// where the processor can, and then copies each sum to its two matrix entries: the values depend
// neither on the number of threads nor on the processor.
#pragma once

#include <vector>

#include "stretchmap/base/types.hpp"
#include "stretchmap/volume/tet_plan.hpp"

namespace stretchmap::volume {

class TetLaplacian {
 public:
  // fixed[i] != 0 marks vertices whose position is prescribed (the set B of Algorithm 5.1); rest
  // (k) holds the positive volumes |tau|. lanes: most tets treated at once (8, 4 or 1), for checks.
  // \pre tets index into [0, fixed.size()).
  TetLaplacian(const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest, int lanes = 8);

  // \return a matrix with the pattern of L_II, to be owned by a solver, values unset. Its rows are
  //         numbered for locality, see interior().
  SparseMatrix pattern() const;

  // Writes L_II into the values of `matrix` and -L_IB x_B into `rhs`, L being L_S of `geometry`
  // (n, 3) with c >= 0; for the source as geometry and c = 0 that is L_D. `x` (n, 3) supplies x_B.
  // \pre matrix has the pattern of pattern().
  void assemble(const PointsRef& geometry, double c, const PointsRef& x, SparseMatrix& matrix,
                Points& rhs);

  const IndexVec& interior() const { return plan_.interior; }  // vertex of each matrix row

  // What an assembly reads beside tets, volumes and positions: where each weight goes.
  double index_bytes() const { return plan_.index_bytes(); }

 private:
  void copy_rows(const PointsRef& x, SparseMatrix& matrix, Points& rhs) const;

  TetPlan plan_;
  int lanes_;
  std::vector<double> x_;     // scratch kept between calls: positions, 4 numbers per vertex,
  std::vector<double> sums_;  // and one number per edge
};

// \param rest_volumes (k) positive.
// \return volumetric stretch energy (5.1) at c = 0, 3/2 sum |f(tau)|^2 / |tau|.
double tet_stretch_energy(const VecRef& image_volumes, const VecRef& rest_volumes);

// \return (n, 3) gradient of tet_stretch_energy with respect to the image, 3 L_S(f) f.
Points tet_stretch_gradient(const PointsRef& image, const TetsRef& tets,
                            const VecRef& rest_volumes);

}  // namespace stretchmap::volume
