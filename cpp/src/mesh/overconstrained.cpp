#include "stretchmap/mesh/overconstrained.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "mesh/diagnosis_common.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/mesh/facets.hpp"
#include "stretchmap/mesh/longest_first.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"

namespace stretchmap::mesh {
namespace {

using Tet = Eigen::Matrix<Index, 1, 4>;
using Pair = Eigen::Matrix<Index, 1, 2>;
using Triple = Eigen::Matrix<Index, 1, 3>;

std::uint64_t key(Index a, Index b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
         static_cast<std::uint64_t>(std::max(a, b));
}

// One vertex to be added in a tet: it replaces each of `corners` (2 or 3 of them) in turn.
struct Split {
  Index tet;
  Index vertex;
  std::array<Index, 3> corners;
  int width;
};

struct Plan {
  OverconstrainedElements found;
  std::vector<Split> splits;
};

// Vertices and edges on the boundary.
class Rim {
 public:
  Rim(const TetsRef& tets, Index n_vertices, const Poll& poll) {
    const TetBoundary boundary = tet_boundary(tets, n_vertices, poll);
    vertices_ = boundary.index;
    edges_.reserve(3 * boundary.faces.rows());
    for (Index f = 0; f < boundary.faces.rows(); ++f) {
      for (int k = 0; k < 3; ++k) {
        edges_.push_back(key(boundary.vertices[boundary.faces(f, k)],
                             boundary.vertices[boundary.faces(f, (k + 1) % 3)]));
      }
    }
    std::sort(edges_.begin(), edges_.end());
  }
  bool has(Index v) const { return vertices_[v] >= 0; }
  bool has(Index a, Index b) const {
    return std::binary_search(edges_.begin(), edges_.end(), key(a, b));
  }

 private:
  IndexVec vertices_;
  std::vector<std::uint64_t> edges_;
};

// Tets with fewer than `least` corners on the boundary.
Mask fewer_on(const Rim& rim, const TetsRef& tets, int least) {
  Mask fewer(tets.rows());
  for_rows(static_cast<Index>(tets.rows()), [&](Index t) {
    int count = 0;
    for (int k = 0; k < 4; ++k) count += rim.has(tets(t, k));
    fewer[t] = count < least;
  });
  return fewer;
}

void plan_edges(const TetsRef& tets, Index n_vertices, const Rim& rim, Plan& plan,
                const Poll& poll) {
  std::vector<Pair> edges;
  const FacetGroups groups = group_tet_edges(tets, n_vertices, fewer_on(rim, tets, 2), poll);
  for (Index g = 0; g < groups.size(); ++g) {
    const Index h = groups.order[groups.start[g]];
    const Index a = tets(h / 6, kTetEdge[h % 6][0]), b = tets(h / 6, kTetEdge[h % 6][1]);
    if (!rim.has(a) || !rim.has(b) || rim.has(a, b)) continue;
    const Index vertex = n_vertices + static_cast<Index>(edges.size());
    edges.emplace_back(std::min(a, b), std::max(a, b));
    for (Index p = groups.start[g]; p < groups.start[g + 1]; ++p) {
      plan.splits.push_back({groups.order[p] / 6, vertex, {a, b, -1}, 2});
    }
  }
  plan.found.edges = as_rows<Edges>(edges);
}

// Added vertices are numbered from `first_vertex`.
void plan_faces(const TetsRef& tets, Index n_vertices, Index first_vertex, const Rim& rim,
                Plan& plan, const Poll& poll) {
  std::vector<Triple> faces;
  const FacetGroups groups = group_half_faces(tets, n_vertices, fewer_on(rim, tets, 3), poll);
  for (Index g = 0; g < groups.size(); ++g) {
    const Index first = groups.start[g];
    if (groups.start[g + 1] - first < 2) continue;
    const Triple f = half_face(tets, groups.order[first]);
    if (!rim.has(f[0], f[1]) || !rim.has(f[1], f[2]) || !rim.has(f[2], f[0])) continue;
    const Index vertex = first_vertex + static_cast<Index>(faces.size());
    faces.push_back(f);
    for (const Index p : {first, first + 1}) {
      plan.splits.push_back({groups.order[p] / 4, vertex, {f[0], f[1], f[2]}, 3});
    }
  }
  plan.found.faces = as_rows<Faces>(faces);
}

Plan plan_splits(const TetsRef& tets, Index n_vertices, const Poll& poll) {
  const IndexVec repeated = set_entries(repeating(tets));
  if (repeated.size() > 0) {
    throw Error("DegenerateError",
                std::to_string(repeated.size()) + " tets repeat a vertex, the first is tet " +
                    std::to_string(repeated[0]) + "; remove them",
                {repeated.begin(), repeated.end()});
  }
  const Rim rim(tets, n_vertices, poll);
  Plan plan;
  plan_edges(tets, n_vertices, rim, plan, poll);
  plan_faces(tets, n_vertices, n_vertices + static_cast<Index>(plan.found.edges.rows()), rim, plan,
             poll);
  Mask touched(tets.rows(), 0);
  for (const Split& split : plan.splits) touched[split.tet] = 1;
  plan.found.tets = set_entries(touched);
  return plan;
}

// Replaces every piece that has all corners of the split by one piece per corner.
void split_pieces(const Split& split, std::vector<Tet>& pieces) {
  const std::size_t n = pieces.size();
  for (std::size_t p = 0; p < n; ++p) {
    const Tet piece = pieces[p];
    std::array<int, 3> place{-1, -1, -1};
    int found = 0;
    for (int c = 0; c < split.width; ++c) {
      for (int k = 0; k < 4; ++k) {
        if (piece[k] == split.corners[c]) place[c] = k, ++found;
      }
    }
    if (found < split.width) continue;
    pieces[p][place[0]] = split.vertex;
    for (int c = 1; c < split.width; ++c) {
      pieces.push_back(piece);
      pieces.back()[place[c]] = split.vertex;
    }
  }
}

}  // namespace

OverconstrainedElements overconstrained_elements(const TetsRef& tets, Index n_vertices,
                                                 const Poll& poll) {
  return plan_splits(tets, n_vertices, poll).found;
}

Refinement refine_overconstrained(const PointsRef& points, const TetsRef& tets,
                                  const PointsRef& seen, const Poll& poll) {
  const Index n = static_cast<Index>(points.rows());
  Plan plan = plan_splits(tets, n, poll);
  const Index n_edges = static_cast<Index>(plan.found.edges.rows());
  const Index n_faces = static_cast<Index>(plan.found.faces.rows());
  Refinement result;
  result.points.resize(n + n_edges + n_faces, 3);
  result.points.topRows(n) = points;
  for (Index i = 0; i < n_edges; ++i) {
    const auto e = plan.found.edges.row(i);
    result.points.row(n + i) = 0.5 * (points.row(e[0]) + points.row(e[1]));
  }
  for (Index j = 0; j < n_faces; ++j) {
    const auto f = plan.found.faces.row(j);
    result.points.row(n + n_edges + j) =
        (points.row(f[0]) + points.row(f[1]) + points.row(f[2])) / 3;
  }
  IndexVec turn = IndexVec::LinSpaced(n_edges + n_faces, 0, n_edges + n_faces - 1);
  const IndexVec order = longest_first(seen, plan.found.edges);
  for (Index k = 0; k < n_edges; ++k) turn[order[k]] = k;
  std::sort(plan.splits.begin(), plan.splits.end(), [&](const Split& a, const Split& b) {
    return std::pair(a.tet, turn[a.vertex - n]) < std::pair(b.tet, turn[b.vertex - n]);
  });
  std::vector<Tet> refined, pieces;
  std::vector<Index> parents;
  refined.reserve(tets.rows() + 2 * plan.splits.size());
  parents.reserve(refined.capacity());
  auto split = plan.splits.begin();
  for (Index t = 0; t < tets.rows(); ++t) {
    pieces.assign(1, tets.row(t));
    for (; split != plan.splits.end() && split->tet == t; ++split) split_pieces(*split, pieces);
    refined.insert(refined.end(), pieces.begin(), pieces.end());
    parents.insert(parents.end(), pieces.size(), t);
  }
  result.tets = as_rows<Tets>(refined);
  result.parent_tet = as_vector(parents);
  result.split = std::move(plan.found);
  return result;
}

}  // namespace stretchmap::mesh
