// A sparse matrix assembled from one dense block per face, on a pattern found once.
#pragma once

#include <vector>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::area {

// `block` unknowns per vertex; unknown c of vertex i is block * i + c.
class SurfacePattern {
 public:
  // \param faces (m, 3) ids below n_vertices.
  SurfacePattern(const FacesRef& faces, Index n_vertices, int block);

  // With this pattern, both triangles stored; its values are for `scatter`.
  SparseMatrix& matrix() { return matrix_; }
  const SparseMatrix& matrix() const { return matrix_; }

  // Overwrites `values` with the sum over the faces, faces in order.
  // \param elements (m, (3 block)^2) row f is the matrix of face f, row-major, unknown c of its
  //        corner k at block * k + c.
  void scatter(const RowsRef& elements, double* values) const;

 private:
  Index block_;
  SparseMatrix matrix_;
  Incidence<> corners_;      // of faces at each vertex
  std::vector<Index> slot_;  // m (3 block)^2 positions in the value array
};

// \param gradients (m, 6) by the two coordinates of each face's corners.
// \return (2 n) their sum, faces in order.
Vec sum_corners(const FacesRef& faces, Index n_vertices, const Rows& gradients);

}  // namespace stretchmap::area
