#include "stretchmap/stretch/tet_laplacian.hpp"

#include <algorithm>
#include <array>

namespace stretchmap {
namespace {

constexpr std::array<std::array<int, 2>, 6> kEdge{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

using Row3 = Eigen::RowVector3d;

// Outward area vectors (length = area of the face opposite the vertex) of a positive tet.
struct AreaVectors {
  std::array<Row3, 4> g;
  double volume;
};

AreaVectors area_vectors(const PointsRef& x, const TetsRef& tets, Index t) {
  const Row3 a = x.row(tets(t, 0));
  const Row3 b = x.row(tets(t, 1)) - a, c = x.row(tets(t, 2)) - a, d = x.row(tets(t, 3)) - a;
  AreaVectors r;
  const Row3 cd = c.cross(d);
  r.g[1] = -0.5 * cd;
  r.g[2] = -0.5 * d.cross(b);
  r.g[3] = -0.5 * b.cross(c);
  r.g[0] = -(r.g[1] + r.g[2] + r.g[3]);
  r.volume = b.dot(cd) / 6.0;
  return r;
}

}  // namespace

TetLaplacian::TetLaplacian(const TetsRef& tets, const FlagsRef& fixed)
    : tets_(tets), n_vertices_(static_cast<Index>(fixed.size())) {
  build_edges();
  build_rows(fixed);
}

// Buckets the slots by their lower vertex, then sorts each bucket by the higher one.
void TetLaplacian::build_edges() {
  const Index n_slots = static_cast<Index>(6 * tets_.rows());
  const Index n = n_vertices_;
  const auto lower = [&](Index s) {
    return std::min(tets_(s / 6, kEdge[s % 6][0]), tets_(s / 6, kEdge[s % 6][1]));
  };
  const auto higher = [&](Index s) {
    return std::max(tets_(s / 6, kEdge[s % 6][0]), tets_(s / 6, kEdge[s % 6][1]));
  };
  std::vector<Index> start(static_cast<std::size_t>(n) + 1, 0);
  for (Index s = 0; s < n_slots; ++s) ++start[lower(s) + 1];
  for (Index i = 0; i < n; ++i) start[i + 1] += start[i];
  edge_slot_.resize(n_slots);
  std::vector<Index> cursor(start.begin(), start.end() - 1);
  for (Index s = 0; s < n_slots; ++s) edge_slot_[cursor[lower(s)]++] = s;

  std::vector<Index> pairs;
  for (Index i = 0; i < n; ++i) {
    std::sort(
        edge_slot_.begin() + start[i], edge_slot_.begin() + start[i + 1],
        [&](Index a, Index b) { return higher(a) != higher(b) ? higher(a) < higher(b) : a < b; });
    for (Index p = start[i]; p < start[i + 1]; ++p) {
      const Index j = higher(edge_slot_[p]);
      if (p == start[i] || j != pairs.back()) {
        pairs.insert(pairs.end(), {i, j});
        edge_start_.push_back(p);
      }
    }
  }
  edge_start_.push_back(n_slots);
  edges_ = Eigen::Map<const Edges>(pairs.data(), static_cast<Index>(pairs.size() / 2), 2);
  slot_weight_.resize(n_slots);
  edge_weight_.resize(edges_.rows());
}

// Interior neighbours of an interior vertex become matrix entries, prescribed ones couplings.
void TetLaplacian::build_rows(const FlagsRef& fixed) {
  const Index n_edges = static_cast<Index>(edges_.rows());
  std::vector<Index> row_of(n_vertices_, -1), interior;
  for (Index i = 0; i < n_vertices_; ++i) {
    if (fixed[i]) continue;
    row_of[i] = static_cast<Index>(interior.size());
    interior.push_back(i);
  }
  const Index rows = static_cast<Index>(interior.size());
  interior_ = Eigen::Map<const IndexVec>(interior.data(), rows);

  outer_.assign(rows + 1, 0);
  couple_start_.assign(rows + 1, 0);
  for (Index e = 0; e < n_edges; ++e) {
    const Index a = row_of[edges_(e, 0)], b = row_of[edges_(e, 1)];
    if (a >= 0) ++(b >= 0 ? outer_[a + 1] : couple_start_[a + 1]);
    if (b >= 0) ++(a >= 0 ? outer_[b + 1] : couple_start_[b + 1]);
  }
  for (Index r = 0; r < rows; ++r) {
    outer_[r + 1] += outer_[r] + 1;  // one more for the diagonal
    couple_start_[r + 1] += couple_start_[r];
  }
  couple_edge_.resize(couple_start_[rows]);
  couple_vertex_.resize(couple_start_[rows]);
  entry_edge_.assign(outer_[rows], -1);
  inner_.resize(outer_[rows]);
  diagonal_.resize(rows);

  std::vector<Index> at(outer_.begin(), outer_.end() - 1);
  std::vector<Index> at_couple(couple_start_.begin(), couple_start_.end() - 1);
  const auto entry = [&](Index row, Index edge, Index column) {
    inner_[at[row]] = column;
    entry_edge_[at[row]++] = edge;
  };
  const auto couple = [&](Index row, Index edge, Index vertex) {
    couple_edge_[at_couple[row]] = edge;
    couple_vertex_[at_couple[row]++] = vertex;
  };
  // Edges come in lexicographic order, so entering the lower neighbours of every row first, then
  // the diagonals, then the higher neighbours leaves each row sorted.
  for (Index e = 0; e < n_edges; ++e) {
    const Index a = row_of[edges_(e, 0)], b = row_of[edges_(e, 1)];
    if (a >= 0 && b >= 0) entry(b, e, a);
  }
  for (Index r = 0; r < rows; ++r) {
    diagonal_[r] = at[r];
    entry(r, -1, r);
  }
  for (Index e = 0; e < n_edges; ++e) {
    const Index a = row_of[edges_(e, 0)], b = row_of[edges_(e, 1)];
    if (a >= 0 && b >= 0) entry(a, e, b);
    if (a >= 0 && b < 0) couple(a, e, edges_(e, 1));
    if (b >= 0 && a < 0) couple(b, e, edges_(e, 0));
  }
  edges_.resize(0, 2);
}

SparseMatrix TetLaplacian::pattern() const {
  const Index rows = static_cast<Index>(interior_.size());
  SparseMatrix matrix(rows, rows);
  matrix.resizeNonZeros(outer_[rows]);
  std::copy(outer_.begin(), outer_.end(), matrix.outerIndexPtr());
  std::copy(inner_.begin(), inner_.end(), matrix.innerIndexPtr());
  return matrix;
}

void TetLaplacian::assemble(const PointsRef& geometry, const VecRef& coef, const PointsRef& x,
                            SparseMatrix& matrix, Points& rhs) {
  const Index k = static_cast<Index>(tets_.rows());
#pragma omp parallel for schedule(static)
  for (Index t = 0; t < k; ++t) {
    const AreaVectors a = area_vectors(geometry, tets_, t);
    for (int s = 0; s < 6; ++s)
      slot_weight_[6 * t + s] = coef[t] * a.g[kEdge[s][0]].dot(a.g[kEdge[s][1]]);
  }
  const Index n_edges = static_cast<Index>(edge_weight_.size());
#pragma omp parallel for schedule(static)
  for (Index e = 0; e < n_edges; ++e) {
    double sum = 0.0;
    for (Index p = edge_start_[e]; p < edge_start_[e + 1]; ++p) sum += slot_weight_[edge_slot_[p]];
    edge_weight_[e] = sum;
  }
  const Index rows = static_cast<Index>(interior_.size());
  double* value = matrix.valuePtr();
  rhs.resize(rows, 3);
#pragma omp parallel for schedule(static)
  for (Index r = 0; r < rows; ++r) {
    double sum = 0.0;
    for (Index p = outer_[r]; p < outer_[r + 1]; ++p) {
      if (entry_edge_[p] < 0) continue;
      value[p] = edge_weight_[entry_edge_[p]];
      sum += value[p];
    }
    Row3 b = Row3::Zero();
    for (Index p = couple_start_[r]; p < couple_start_[r + 1]; ++p) {
      const double w = edge_weight_[couple_edge_[p]];
      sum += w;
      b -= w * x.row(couple_vertex_[p]);
    }
    value[diagonal_[r]] = -sum;
    rhs.row(r) = b;
  }
}

Vec signed_tet_volumes(const PointsRef& x, const TetsRef& tets) {
  Vec volumes(tets.rows());
  const Index k = static_cast<Index>(tets.rows());
#pragma omp parallel for schedule(static)
  for (Index t = 0; t < k; ++t) {
    const Row3 a = x.row(tets(t, 0));
    const Row3 b = x.row(tets(t, 1)) - a, c = x.row(tets(t, 2)) - a, d = x.row(tets(t, 3)) - a;
    volumes[t] = b.dot(c.cross(d)) / 6.0;
  }
  return volumes;
}

double tet_stretch_energy(const VecRef& image_volumes, const VecRef& rest_volumes) {
  return 1.5 * (image_volumes.array().square() / rest_volumes.array()).sum();
}

Points tet_stretch_gradient(const PointsRef& image, const TetsRef& tets,
                            const VecRef& rest_volumes) {
  Points gradient = Points::Zero(image.rows(), 3);
  for (Index t = 0; t < tets.rows(); ++t) {
    const AreaVectors a = area_vectors(image, tets, t);
    // d|f| / df_i = -g_i / 3
    const double factor = -a.volume / rest_volumes[t];
    for (int i = 0; i < 4; ++i) gradient.row(tets(t, i)) += factor * a.g[i];
  }
  return gradient;
}

}  // namespace stretchmap
