// Shared by the two diagnoses and by what repairs.
#pragma once

#include <algorithm>
#include <vector>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/mesh/disjoint_sets.hpp"
#include "stretchmap/mesh/facets.hpp"
#include "stretchmap/mesh/orient.hpp"

namespace stretchmap::mesh {

template <class Elements>
Mask repeating(const Elements& elements) {
  Mask mask(elements.rows(), 0);
  for_rows(static_cast<Index>(elements.rows()), [&](Index e) {
    for (Index i = 0; i < elements.cols(); ++i) {
      for (Index j = 0; j < i; ++j) mask[e] |= elements(e, i) == elements(e, j);
    }
  });
  return mask;
}

// All but the first member of each group.
inline Mask later_members(const FacetGroups& groups, Index n) {
  Mask mask(n, 0);
  for_rows(groups.size(), [&](Index g) {
    for (Index p = groups.start[g] + 1; p < groups.start[g + 1]; ++p) mask[groups.order[p]] = 1;
  });
  return mask;
}

// Elements that no check looks at: those that repeat a vertex, and later copies.
struct LeftOut {
  Mask repeated, copies, either;
};

template <class Elements>
LeftOut left_out(const Elements& elements, const FacetGroups& equal) {
  LeftOut out;
  out.repeated = repeating(elements);
  out.copies = later_members(equal, static_cast<Index>(elements.rows()));
  out.either = out.repeated;
  for_rows(static_cast<Index>(elements.rows()), [&](Index e) {
    if (out.repeated[e]) out.copies[e] = 0;
    out.either[e] |= out.copies[e];
  });
  return out;
}

inline IndexVec negative_entries(const IndexVec& values) {
  Mask mask(values.size(), 0);
  for (Index i = 0; i < values.size(); ++i) mask[i] = values[i] < 0;
  return set_entries(mask);
}

inline IndexVec as_vector(const std::vector<Index>& ids) {
  return Eigen::Map<const IndexVec>(ids.data(), static_cast<Eigen::Index>(ids.size()));
}

// Row by row copy of a list of fixed-size rows.
template <class Matrix, class Row>
Matrix as_rows(const std::vector<Row>& rows) {
  Matrix matrix(static_cast<Eigen::Index>(rows.size()), Matrix::ColsAtCompileTime);
  for (std::size_t i = 0; i < rows.size(); ++i) matrix.row(i) = rows[i];
  return matrix;
}

// Vertices whose corners fall into several sets. Corner w e + k is corner k of
// element e with w corners.
template <class Elements>
void mark_split_corners(const Elements& elements, const Mask& skip, DisjointSets& corners,
                        Mask& split) {
  const Index width = static_cast<Index>(elements.cols());
  std::vector<Index> first(split.size(), -1);
  for (Index e = 0; e < elements.rows(); ++e) {
    if (skip[e]) continue;
    for (Index k = 0; k < width; ++k) {
      const Index set = corners.find(width * e + k);
      Index& seen = first[elements(e, k)];
      if (seen < 0) seen = set;
      if (seen != set) split[elements(e, k)] = 1;
    }
  }
}

}  // namespace stretchmap::mesh
