#include "stretchmap/area/surface_pattern.hpp"

#include <algorithm>

namespace stretchmap::area {

namespace {

// Each vertex and its neighbors, ascending.
std::vector<std::vector<Index>> adjacency(const FacesRef& faces, Index n) {
  std::vector<std::vector<Index>> rows(static_cast<std::size_t>(n));
  for (Index f = 0; f < faces.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) rows[faces(f, k)].push_back(faces(f, l));
  for (auto& row : rows) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
  }
  return rows;
}

}  // namespace

SurfacePattern::SurfacePattern(const FacesRef& faces, Index n, int block)
    : zeros_(n * block, n * block) {
  const auto rows = adjacency(faces, n);
  std::vector<Index> start(static_cast<std::size_t>(n) + 1, 0);
  for (Index i = 0; i < n; ++i)
    start[i + 1] = start[i] + block * block * static_cast<Index>(rows[i].size());
  zeros_.resizeNonZeros(start[n]);
  std::fill_n(zeros_.valuePtr(), start[n], 0.0);
  for (Index i = 0; i < n; ++i) {
    const Index width = block * static_cast<Index>(rows[i].size());
    for (int c = 0; c < block; ++c) {
      zeros_.outerIndexPtr()[block * i + c] = start[i] + c * width;
      for (Index e = 0; e < width; ++e)
        zeros_.innerIndexPtr()[start[i] + c * width + e] = block * rows[i][e / block] + e % block;
    }
  }
  zeros_.outerIndexPtr()[n * block] = start[n];

  slot_.reserve(static_cast<std::size_t>(faces.rows()) * 9 * block * block);
  for (Index f = 0; f < faces.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto& row = rows[faces(f, k)];
      const Index width = block * static_cast<Index>(row.size());
      for (int c = 0; c < block; ++c)
        for (int l = 0; l < 3; ++l) {
          const auto found = std::lower_bound(row.begin(), row.end(), faces(f, l));
          const Index column = block * static_cast<Index>(found - row.begin());
          for (int d = 0; d < block; ++d)
            slot_.push_back(start[faces(f, k)] + c * width + column + d);
        }
    }
}

void SurfacePattern::scatter(const RowsRef& elements, double* values) const {
  std::fill_n(values, zeros_.nonZeros(), 0.0);
  const double* entry = elements.data();
  for (const Index slot : slot_) values[slot] += *entry++;
}

Vec sum_corners(const FacesRef& faces, Index n_vertices, const Rows& gradients) {
  Vec sum = Vec::Zero(2 * n_vertices);
  for (Index f = 0; f < faces.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      sum.segment<2>(2 * faces(f, k)) += gradients.row(f).segment<2>(2 * k).transpose();
  return sum;
}

}  // namespace stretchmap::area
