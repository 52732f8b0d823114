// How SolidEnergy numbers its rows and elements, and the block pattern of its Hessian.
#include <algorithm>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/memory.hpp"
#include "stretchmap/linalg/pattern.hpp"
#include "stretchmap/volume/solid_energy.hpp"

namespace stretchmap::volume {
namespace {

using Eigen::RowVector3d;

// Position along the Z-order curve with 10 bits an axis.
std::uint32_t z_order(const RowVector3d& unit) {
  std::uint32_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto cell = static_cast<std::uint32_t>(std::clamp(unit[axis], 0.0, 0.999999) * 1024.0);
    for (int bit = 0; bit < 10; ++bit) code |= ((cell >> bit) & 1u) << (3 * bit + axis);
  }
  return code;
}

}  // namespace

SolidEnergy::SolidEnergy(const SolidElements& elements, const PointsRef& x,
                         GlidingBoundary boundary)
    : motion_(elements.motion), barrier_(std::move(boundary)) {
  const TetsRef& tets = elements.tets;
  const Index n = static_cast<Index>(motion_.size()), k = static_cast<Index>(tets.rows());
  const RowVector3d low = x.colwise().minCoeff();
  const double size = std::max((x.colwise().maxCoeff() - low).maxCoeff(), 1e-300);
  std::vector<std::uint32_t> code(n);
  std::vector<Index> active;
  for_rows(n, [&](Index i) { code[i] = z_order((x.row(i) - low) / size); });
  for (Index i = 0; i < n; ++i)
    if (motion_[i] != kFixed) active.push_back(i);
  std::stable_sort(active.begin(), active.end(),
                   [&](Index a, Index b) { return code[a] < code[b]; });
  row_vertex_ = Eigen::Map<const IndexVec>(active.data(), static_cast<Index>(active.size()));
  vertex_row_.setConstant(n, -1);
  for (Index row = 0; row < row_vertex_.size(); ++row) vertex_row_[row_vertex_[row]] = row;

  // Tets by their lowest row, those without any at the end.
  IndexVec lowest = IndexVec::Constant(k, rows());
  for_rows(k, [&](Index t) {
    for (int a = 0; a < 4; ++a)
      if (vertex_row_[tets(t, a)] >= 0) lowest[t] = std::min(lowest[t], vertex_row_[tets(t, a)]);
  });
  const Incidence<> by_row = corners_at(lowest, rows() + 1);
  order_ = Eigen::Map<const IndexVec>(by_row.of(0, rows() + 1).begin(), k);
  tets_.resize(k, 4);
  rest_.resize(k, 9);
  prefer_large_pages(rest_.data(), sizeof(double) * rest_.size());
  weights_.resize(k);
  for_rows(k, [&](Index t) {
    tets_.row(t) = tets.row(order_[t]);
    rest_.row(t) = elements.rest.row(order_[t]);
    weights_[t] = elements.weights[order_[t]];
  });
  number_sites();
}

void SolidEnergy::number_sites() {
  std::vector<bool> on_surface(motion_.size(), false);
  for (Index i = 0; i < motion_.size(); ++i) on_surface[i] = motion_[i] == kGliding;
  for (Index f = 0; f < barrier_.size(); ++f)
    for (int k = 0; k < 3; ++k) on_surface[barrier_.faces()(f, k)] = true;
  site_number_.setConstant(motion_.size(), -1);
  for (Index i = 0; i < motion_.size(); ++i) {
    if (!on_surface[i]) continue;
    site_number_[i] = static_cast<Index>(site_vertex_.size());
    site_vertex_.push_back(i);
  }
  site_place_.assign(site_vertex_.size(), -1);
}

linalg::BlockMatrix SolidEnergy::build_pattern() {
  const Index n_rows = rows(), k = static_cast<Index>(tets_.rows());
  const Incidence<> corners =
      corners_at(tets_, n_rows, [&](Index vertex) { return vertex_row_[vertex]; });
  const auto for_corners = [&](Index row, const auto& visit) {
    for (const Index corner : corners[row])
      for (int b = 0; b < 4; ++b)
        if (const Index other = vertex_row_[tets_(corner / 4, b)]; other >= 0)
          visit(corner, b, other);
  };

  const linalg::Pattern pattern =
      linalg::build_pattern(n_rows, n_rows, [&](Index row, linalg::RowSet& set) {
        set.add(row);
        for_corners(row, [&](Index, int, Index other) { set.add(other); });
      });
  linalg::BlockMatrix matrix;
  matrix.row_ptr = row_ptr_ = Eigen::Map<const IndexVec>(pattern.start.data(), n_rows + 1);
  matrix.col =
      Eigen::Map<const IndexVec>(pattern.col.data(), static_cast<Index>(pattern.col.size()));

  place_.resize(k, 16);  // those without a row are never looked at
  for_chunks_with(
      n_rows, kChunk, [&] { return std::vector<Index>(n_rows); },
      [&](Index begin, Index end, std::vector<Index>& place) {
        for (Index row = begin; row < end; ++row) {
          for (Index p = row_ptr_[row]; p < row_ptr_[row + 1]; ++p)
            place[pattern.col[p]] = std::min<Index>(p - row_ptr_[row], kFar);
          for_corners(row, [&](Index at, int b, Index other) {
            place_(at / 4, 4 * (at % 4) + b) = static_cast<std::uint8_t>(place[other]);
          });
        }
      });
  return matrix;
}

void SolidEnergy::find_face_slots(const IndexVec& col) {
  const Index m = barrier_.size();
  face_slot_.setConstant(m, 9, -1);
  for (Index f = 0; f < m; ++f)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const Index row = vertex_row_[barrier_.faces()(f, a)];
        const Index column = vertex_row_[barrier_.faces()(f, b)];
        if (row >= 0 && column >= 0) face_slot_(f, 3 * a + b) = find_block(col, row, column);
      }
}

// A part per thread, and which elements it has to add up.
void SolidEnergy::part_rows() {
  const Index n_rows = rows();
  const Index parts = std::clamp<Index>(n_rows / kElementChunk, 1, thread_count());
  part_row_.resize(parts + 1);
  for (Index p = 0; p <= parts; ++p)
    part_row_[p] = static_cast<Index>(static_cast<std::int64_t>(n_rows) * p / parts);
  const auto touching = [&](const auto& elements) {
    std::vector<std::vector<Index>> lists(parts);
    for_tasks(parts, [&](Index p) {
      const auto inside = [&](Index vertex) {
        return vertex_row_[vertex] >= part_row_[p] && vertex_row_[vertex] < part_row_[p + 1];
      };
      for (Index t = 0; t < elements.rows(); ++t)
        if (elements.row(t).unaryExpr(inside).any()) lists[p].push_back(t);
    });
    return lists;
  };
  part_tets_ = touching(tets_);
  part_faces_ = touching(barrier_.faces());
}

Index SolidEnergy::find_block(const IndexVec& col, Index row, Index column) const {
  const Index* first = col.data() + row_ptr_[row];
  const Index* last = col.data() + row_ptr_[row + 1];
  return static_cast<Index>(std::lower_bound(first, last, column) - col.data());
}

linalg::BlockMatrix SolidEnergy::pattern() {
  linalg::BlockMatrix matrix = build_pattern();
  find_face_slots(matrix.col);
  part_rows();
  matrix.values.resize(9 * matrix.col.size());
  prefer_large_pages(matrix.values.data(), sizeof(double) * matrix.values.size());
  return matrix;
}

}  // namespace stretchmap::volume
