// Distortion of a hexahedral grid, and how far its boundary is from a surface.
//
//   Psi(x) = sum_h weight_h / 8 sum_t f(psi(J_ht))
//            + sum_j c_j g(n_j . (sum_i w_ji x_i - y_j) + inward),
//   f(psi) = ((1 + psi)^p - 1) / p,     J_ht = [e_1, e_2, e_3] diag(1 / sides),
//
// over triples t of edges e_1, e_2, e_3 of each hexahedron, those at its eight corners and, where
// it is guarded, the 24 others of edge_triples with a third of the weight; these keep the Jacobian
// determinant positive between the corners. psi is the energy of element_energy.hpp (Garanzha et
// al. 2021): the rest shape is a box. The larger p, the more the worst triples count: with shape
// alone, edges of the right lengths and p = 3/2, f is 2/3 of (1 / scaled Jacobian - 1). The second
// sum is that of boundary_fit.hpp.
//
// Rows of the Hessian are the points of the grid; each is summed by one thread over its hexahedra
// in ascending order, so that the bits do not depend on the number of threads.
#pragma once

#include <vector>

#include "stretchmap/linalg/block_solver.hpp"
#include "stretchmap/resample/boundary_fit.hpp"
#include "stretchmap/resample/hexahedra.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::resample {

struct HexWeights {
  volume::EnergyWeights corner;
  double power = 1.0;
};

// What a gap d costs: g(d) = t^2 ((1 + d^2 / t^2)^p - 1) / p, about d^2 below the tolerance t and
// the power 2 p of d above, so that the largest gaps count most.
struct FitNorm {
  double tolerance = 1.0;
  double power = 1.0;
  double inward = 0.0;  // how far inside the surface the grid's boundary is to lie

  double base(double d) const { return 1.0 + d * d / (tolerance * tolerance); }
  double value(double d) const;
  double slope(double d) const;
  double curvature(double d) const;
};

struct HexReport {
  double energy = 0.0;  // +infinity if epsilon = 0 and a corner is not positive
  double fit = 0.0;     // the second sum alone
  double min_det = 0.0;
  Index flips = 0;  // triples with det J <= 0
};

class HexEnergy {
 public:
  // \param hexes (k, 8) ids below n.
  HexEnergy(const HexesRef& hexes, Index n);

  // To be called before anything else below.
  // \param sides (k, 24) lengths of the boxes, each corner's in the order of its neighbors in
  // kCorners.
  // \param weights (k)
  // \param guarded (k) which of them are.
  void set_rest(const Eigen::Ref<const Rows24>& sides, const VecRef& weights, Flags guarded);
  // \param samples their corners are those of a face of a hexahedron.
  // \param factor (s) the c_j.
  void set_fit(FitSamples samples, const VecRef& factor, const FitNorm& norm = {});

  Index rows() const { return n_; }
  linalg::BlockMatrix pattern() const;
  HexReport value(const PointsRef& x, const HexWeights& w) const;
  // Gradient (n, 3) and positive semi-definite Hessian. \pre value(x, w).energy is finite.
  void model(const PointsRef& x, const HexWeights& w, Points& gradient,
             linalg::BlockMatrix& hessian) const;

 private:
  // Batches of eight triples.
  int batches(Index h) const { return guarded_[h] ? 4 : 1; }
  double weight(Index h, int part) const { return part == 0 ? weights_[h] : weights_[h] / 3.0; }
  void load(const PointsRef& x, Index h, int part, volume::ElementBatch& batch) const;
  void add(const volume::ElementBatch& batch, double power, Index h, int part, Index first,
           Index last, Points& gradient, double* blocks) const;
  double gap(const PointsRef& x, Index j) const;
  void add_fit(const PointsRef& x, Points& gradient, double* blocks) const;
  Index find_block(Index row, Index column) const;

  Index n_;
  Hexes hexes_;
  Rows24 inverse_;  // (k, 24) reciprocal sides
  Vec weights_, factor_;
  Flags guarded_;
  FitSamples fit_;
  FitNorm norm_;
  IndexVec row_ptr_, col_;
  IndexRows slot_;                              // (k, 64) block of each pair of corners, or -1
  std::vector<std::vector<Index>> part_hexes_;  // those that touch the rows of each part, ascending
};

}  // namespace stretchmap::resample
