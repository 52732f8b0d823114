#include "stretchmap/area/surface_pattern.hpp"

#include <algorithm>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/linalg/pattern.hpp"

namespace stretchmap::area {

SurfacePattern::SurfacePattern(const FacesRef& faces, Index n, int block)
    : block_(block), matrix_(n * block, n * block), corners_(corners_at(faces, n)) {
  const linalg::Pattern rows = linalg::build_pattern(n, n, [&](Index i, linalg::RowSet& set) {
    for (const Index corner : corners_[i])
      for (int l = 0; l < 3; ++l) set.add(faces(corner / 3, l));
  });
  const Index entries = 3 * block * block;  // of a face in the rows of one of its vertices
  matrix_.resizeNonZeros(block * block * rows.start[n]);
  slot_.resize(static_cast<std::size_t>(faces.rows()) * 3 * entries);
  matrix_.outerIndexPtr()[0] = 0;
  for_rows(n, kElementChunk, [&](Index i) {
    const auto first = rows.col.begin() + rows.start[i],
               last = rows.col.begin() + rows.start[i + 1];
    const Index start = block * block * rows.start[i];
    const Index width = block * static_cast<Index>(last - first);
    for (int c = 0; c < block; ++c) {
      matrix_.outerIndexPtr()[block * i + c + 1] = start + (c + 1) * width;
      for (Index e = 0; e < width; ++e) {
        matrix_.innerIndexPtr()[start + c * width + e] = block * first[e / block] + e % block;
        matrix_.valuePtr()[start + c * width + e] = 0.0;
      }
    }
    for (const Index corner : corners_[i]) {
      Index* slot = slot_.data() + static_cast<std::size_t>(corner) * entries;
      for (int c = 0; c < block; ++c)
        for (int l = 0; l < 3; ++l) {
          const auto found = std::lower_bound(first, last, faces(corner / 3, l));
          for (int d = 0; d < block; ++d)
            *slot++ = start + c * width + block * static_cast<Index>(found - first) + d;
        }
    }
  });
}

// Row by row, so that threads share them.
void SurfacePattern::scatter(const RowsRef& elements, double* values) const {
  const Index entries = 3 * block_ * block_;
  const Index* start = matrix_.outerIndexPtr();
  for_rows(static_cast<Index>(matrix_.rows()) / block_, kElementChunk, [&](Index i) {
    std::fill(values + start[block_ * i], values + start[block_ * (i + 1)], 0.0);
    for (const Index corner : corners_[i]) {
      const auto first = static_cast<std::size_t>(corner) * entries;
      const double* entry = elements.data() + first;
      const Index* slot = slot_.data() + first;
      for (Index e = 0; e < entries; ++e) values[slot[e]] += entry[e];
    }
  });
}

Vec sum_corners(const FacesRef& faces, Index n_vertices, const Rows& gradients) {
  Vec sum = Vec::Zero(2 * n_vertices);
  for (Index f = 0; f < faces.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      sum.segment<2>(2 * faces(f, k)) += gradients.row(f).segment<2>(2 * k).transpose();
  return sum;
}

}  // namespace stretchmap::area
