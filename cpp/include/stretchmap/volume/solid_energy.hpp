// The distortion energy of a whole solid map, its gradient and its positive semi-definite Hessian.
//
//   Psi(x) = sum_t weight_t psi(J_t) + face * (energy of the gliding boundary triangles),
//   J_t    = [x1 - x0, x2 - x0, x3 - x0] * rest_t,
//
// with psi of element_energy.hpp. Each vertex is free, fixed, or glides on a surface. A gliding
// vertex has two unknowns, along the first two axes of its frame there; its block is written in
// that frame with the third unknown absent (identity row).
//
// Every block row is summed by one thread over its tets in a fixed order: same bits for any number
// of threads. Rows are numbered along a space-filling curve.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "stretchmap/linalg/block_solver.hpp"
#include "stretchmap/volume/boundary_barrier.hpp"
#include "stretchmap/volume/element_energy.hpp"

namespace stretchmap::volume {

enum Motion : std::uint8_t { kFree = 0, kFixed = 1, kGliding = 2 };

struct EnergyReport {
  double energy = 0.0;  // +infinity if epsilon = 0 and a tet is inverted, or a face is folded
  double min_det = 0.0;
  Index flips = 0;          // tets with det J <= 0
  double min_facing = 1.0;  // least sigma_k of the gliding faces, see boundary_barrier.hpp
  Index folds = 0;          // faces with one that is not positive
};

// Elements whose energy a whole step would raise.
struct HeldUp {
  std::vector<Index> tets, faces;

  std::size_t size() const { return tets.size() + faces.size(); }
};

// A step shortened at some vertices, where it leads, and the energy there.
struct EasedStep {
  Points step, image;
  EnergyReport there{std::numeric_limits<double>::infinity()};
  HeldUp held_up;  // if it is but a handful, by the numbers tets and faces were given with
};

struct SolidElements {
  TetsRef tets;     // (k, 4)
  RowsRef rest;     // (k, 9) row-major 3x3 matrices
  VecRef weights;   // (k) > 0
  FlagsRef motion;  // (n) of Motion values
};

class SolidEnergy {
 public:
  // \param x (n, 3) what rows are numbered by.
  // \param boundary needed where vertices glide.
  SolidEnergy(const SolidElements& elements, const PointsRef& x, GlidingBoundary boundary = {});

  Index tets() const { return static_cast<Index>(tets_.rows()); }
  Index rows() const { return static_cast<Index>(row_vertex_.size()); }
  // Of the Hessian, values yet to be set. Found when it is asked for: an energy may only be looked
  // at.
  linalg::BlockMatrix pattern();

  // From now on J is multiplied by target^(-1/3): det J = 1 where a tet has `target` times the
  // volume the rest matrix asks for.
  // \param target (k) > 0, in the order of the tets given.
  void set_targets(const VecRef& target);

  // From now on an inverted tet has an epsilon of its own, at least `share` of its determinant at
  // x: then what is inverted far does not outweigh all else. A share of 0: the same for all.
  void soften(const PointsRef& x, double share);

  // \param x (n, 3), here and below.
  // \return energy +infinity where it is not defined.
  EnergyReport value(const PointsRef& x, const EnergyWeights& w) const;

  // \param gradient (rows, 3) in vertex frames.
  // \param hessian likewise, positive semi-definite if w.negative is 0; not computed if null.
  // \pre value(x, w).energy is finite, and pattern() has been asked for.
  void model(const PointsRef& x, const EnergyWeights& w, Points& gradient,
             linalg::BlockMatrix* hessian) const;

  // \return x moved by alpha * step (rows, 3); gliding vertices stay on their surface.
  Points move(const PointsRef& x, const PointsRef& step, double alpha) const;

  // \return 0.9 times the largest alpha for which no tet that is positive at x turns over along the
  //         straight line of the step, at most 1.
  double longest_step(const PointsRef& x, const PointsRef& step) const;

  // \return the step, shortened at the vertices of those tets that would turn over first, so that a
  //         handful of them does not hold up all others; nothing if none does, or too many do.
  std::optional<Points> held_back(const PointsRef& x, const PointsRef& step) const;

  // Where vertices glide, a few may go uphill that the model sends down: at the edges of a mesh it
  // knows the surface on one side only.
  // The step is shortened at the vertices of those elements whose energy it raises by more than
  // `most`, again and again until the energy falls by `enough`. On a smooth surface only a handful
  // may be.
  // \return the best of these; an infinite energy if there are none.
  EasedStep eased(const PointsRef& x, const PointsRef& step, const EnergyWeights& w, double most,
                  double enough) const;

  // \return (3 rows, 3) three translations as seen from the vertex frames.
  Rows near_nullspace(const PointsRef& x) const;

 private:
  // What the surface has at its vertices; frames and turns only if derivatives are wanted.
  GlideSites sites(const PointsRef& x, bool derivatives) const;
  Eigen::Matrix3d frame(const GlideSites& sites, Index vertex) const;
  Points in_space(const PointsRef& x, const PointsRef& step) const;  // (n, 3) of a step in frames
  // visit(t, lane, batch) for the tets t = item(p), p in [first, last), after evaluate(batch, w).
  template <class Item, class Visit>
  void for_batches(const PointsRef& x, const EnergyWeights& w, Index first, Index last,
                   void (*evaluate)(ElementBatch&, const EnergyWeights&), const Item& item,
                   const Visit& visit) const;
  struct Energies {
    Vec tets, det;      // (k) in the sorted order
    Vec faces, facing;  // (m), empty without a barrier
  };
  Energies energies(const PointsRef& x, const EnergyWeights& w) const;
  static EnergyReport summed(const Energies& found);
  static HeldUp harmed(const Energies& before, const Energies& after, double most);
  void shorten(const HeldUp& at, Points& step) const;
  void number_sites();
  linalg::BlockMatrix build_pattern();
  void find_face_slots(const IndexVec& col);
  void part_rows();
  // Position of a column of a row among all columns, `col`.
  Index find_block(const IndexVec& col, Index row, Index column) const;
  void add_element(const ElementBatch& batch, int lane, Index t, Index first, Index last,
                   Points& gradient, linalg::BlockMatrix* hessian) const;
  void add_face(const PointsRef& x, const GlideSites& sites, const EnergyWeights& w, Index f,
                Index first, Index last, Points& gradient, linalg::BlockMatrix* hessian) const;
  void into_frames(const PointsRef& x, const GlideSites& sites, double negative, Index row,
                   Points& gradient, linalg::BlockMatrix* hessian) const;

  static constexpr std::uint8_t kFar = 0xFF;
  Tets tets_;       // sorted by lowest row
  IndexVec order_;  // which of the tets given each of them is
  Vec own_;         // (k) in the sorted order, see ElementBatch; empty: zeros
  Vec target_;      // (k) in the sorted order; empty: ones
  Rows rest_;
  Vec weights_;
  Flags motion_;
  BoundaryBarrier barrier_;
  std::vector<Index> site_vertex_;         // vertices that glide or are corners of gliding faces
  IndexVec site_number_;                   // (n) of each of them, -1 of all others
  mutable std::vector<Index> site_place_;  // of each of them when last looked for, -1 at first
  IndexVec row_vertex_;                    // vertex of each row
  IndexVec vertex_row_;                    // row of each vertex, -1 if fixed
  IndexVec row_ptr_;                       // of the block pattern
  // (k, 16) position within the row of each pair of a tet's vertices, kFar if it is beyond reach.
  Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 16, Eigen::RowMajor> place_;
  IndexRows face_slot_;          // (m, 9) block of each pair of a face's vertices, -1 if none
  std::vector<Index> part_row_;  // rows of part p: [part_row_[p], part_row_[p + 1])
  std::vector<std::vector<Index>> part_tets_;   // tets that touch them, ascending
  std::vector<std::vector<Index>> part_faces_;  // and faces
};

}  // namespace stretchmap::volume
