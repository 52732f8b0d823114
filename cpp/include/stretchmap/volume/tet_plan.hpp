// Where the weights of every tet go: numbering, matrix pattern and slots of a TetLaplacian, found
// once per mesh.
//
// Vertices are numbered breadth first and tets by their lowest vertex, so that what the tets of a
// group touch is close together whatever the caller's numbering. The free vertices, in that order,
// are the rows. An edge belongs to its lower free end and has one slot, where the weights of its
// tets are summed. Vertices are split into chunks of equal size; a chunk sums all edges that belong
// to its vertices by itself, so tets on a seam are computed by each chunk they touch. Neither
// chunks nor the order of summation depend on the number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "stretchmap/base/buffer.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::volume {

struct TetPlan {
  Buffer<Index> order;  // caller's vertex of each internal one
  IndexVec interior;    // caller's vertex of each row

  std::vector<Index> outer;  // the matrix pattern
  Buffer<Index> inner;

  // The tets of chunk c are [chunk_tet[c], chunk_tet[c + 1]), a multiple of the kernel's group; its
  // slots are [chunk_slot[c], chunk_slot[c + 1]), the last of which is never read.
  std::vector<std::int64_t> chunk_tet;
  std::vector<Index> chunk_slot;
  Buffer<Index> corners;  // 4 per tet, internal vertices
  Buffer<double> rest;    // volume per tet
  Buffer<Index> slots;    // 6 per tet

  // The entries of row r before the diagonal have the slots lower_slot[lower_start[r] ...], those
  // after it and then its prescribed neighbors successive ones from row_slot[r] on.
  std::vector<Index> lower_start, couple_start;
  Buffer<Index> lower_slot, row_slot;
  Buffer<Index> couple_vertex;  // prescribed neighbors, the caller's vertices

  Index rows() const { return static_cast<Index>(interior.size()); }
  Index chunks() const { return static_cast<Index>(chunk_slot.size()) - 1; }
  // \return what assembly reads of the plan beyond tets and volumes.
  double index_bytes() const;
};

// fixed[i] != 0 marks vertices whose position is prescribed; rest (k) positive volumes.
// \pre tets index into [0, fixed.size()).
TetPlan make_tet_plan(const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest);

}  // namespace stretchmap::volume
