#include "stretchmap/mesh/facets.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::mesh {
namespace {

constexpr Index kBetweenPolls = 128 * kElementChunk;  // vertices

// All but the lowest vertex of a facet in ascending order, packed, and the facet.
template <int N>
struct Key {
  std::uint64_t high;  // second and third lowest vertex
  std::uint32_t low;   // fourth, for whole tets
  Index facet;

  Key() = default;
  Key(const std::array<Index, N>& c, Index f)
      : high(static_cast<std::uint64_t>(c[1]) << 32 | static_cast<std::uint32_t>(c[2])),
        low(static_cast<std::uint32_t>(c[N - 1])),
        facet(f) {}
  bool same(const Key& other) const { return high == other.high && low == other.low; }
  bool operator<(const Key& other) const {
    if (high != other.high) return high < other.high;
    return low != other.low ? low < other.low : facet < other.facet;
  }
};

template <>
struct Key<2> {
  std::uint32_t high;
  Index facet;

  Key() = default;
  Key(const std::array<Index, 2>& c, Index f) : high(static_cast<std::uint32_t>(c[1])), facet(f) {}
  bool same(const Key& other) const { return high == other.high; }
  bool operator<(const Key& other) const {
    return high != other.high ? high < other.high : facet < other.facet;
  }
};

constexpr int kHalfEdge[3][2] = {{0, 1}, {1, 2}, {2, 0}};
constexpr int kFace[1][3] = {{0, 1, 2}};
constexpr int kTet[1][4] = {{0, 1, 2, 3}};

// The ids in ascending order, without a branch that could only be guessed.
template <std::size_t N>
void sort_few(std::array<Index, N>& ids) {
  for (std::size_t last = N - 1; last > 0; --last)
    for (std::size_t i = 0; i < last; ++i) {
      const Index a = ids[i], b = ids[i + 1];
      ids[i] = std::min(a, b);
      ids[i + 1] = std::max(a, b);
    }
}

// Facet F e + j of element e has the element's corners facet[j]. Facets are listed at their lowest
// vertices; a short sort there brings equal ones together.
template <class Elements, int F, int N>
FacetGroups group(const Elements& elements, const int (&facet)[F][N], Index n, const Mask& skip,
                  const Poll& poll) {
  const auto ids_of = [&](Index e, int j) {
    std::array<Index, N> ids;
    for (int i = 0; i < N; ++i) ids[i] = elements(e, facet[j][i]);
    return ids;
  };
  const Index m = static_cast<Index>(elements.rows());
  const Incidence<> facets = listed_at(n, m, [&](Index e, const auto& visit) {
    if (!skip.empty() && skip[e]) return;
    for (int j = 0; j < F; ++j) {
      const std::array<Index, N> ids = ids_of(e, j);
      Index lowest = ids[0];
      for (int i = 1; i < N; ++i) lowest = std::min(lowest, ids[i]);
      visit(lowest, F * e + j);
    }
  });
  const auto gather = [&](Index vertex, std::vector<Key<N>>& keys) {
    keys.clear();
    for (const Index f : facets[vertex]) {
      std::array<Index, N> ids = ids_of(f / F, f % F);
      sort_few(ids);
      keys.emplace_back(ids, f);
    }
    std::sort(keys.begin(), keys.end());
  };
  FacetGroups groups;
  const Index* const all = facets.of(0, n).begin();
  groups.order.resize(facets.of(0, n).end() - all);
  std::vector<std::vector<Index>> starts(static_cast<std::size_t>(chunk_count(n, kElementChunk)));
  for (Index first = 0; first < n; first += kBetweenPolls) {
    if (poll) poll();
    for_chunks_with(
        std::min(kBetweenPolls, n - first), kElementChunk, [] { return std::vector<Key<N>>(); },
        [&](Index begin, Index end, std::vector<Key<N>>& keys) {
          std::vector<Index>& start = starts[(first + begin) / kElementChunk];
          const auto here = facets.of(first + begin, first + end);
          start.reserve(here.end() - here.begin());
          Index at = static_cast<Index>(here.begin() - all);
          for (Index i = first + begin; i < first + end; ++i) {
            gather(i, keys);
            for (std::size_t p = 0; p < keys.size(); ++p) {
              if (p == 0 || !keys[p].same(keys[p - 1])) start.push_back(at);
              groups.order[at++] = keys[p].facet;
            }
          }
        });
  }
  groups.start = joined(starts, 1);
  groups.start.back() = static_cast<Index>(groups.order.size());
  return groups;
}

}  // namespace

FacetGroups group_half_edges(const FacesRef& faces, Index n_vertices, const Mask& skip,
                             const Poll& poll) {
  return group(faces, kHalfEdge, n_vertices, skip, poll);
}

FacetGroups group_half_faces(const TetsRef& tets, Index n_vertices, const Mask& skip,
                             const Poll& poll) {
  return group(tets, kTetFace, n_vertices, skip, poll);
}

FacetGroups group_tet_edges(const TetsRef& tets, Index n_vertices, const Mask& skip,
                            const Poll& poll) {
  return group(tets, kTetEdge, n_vertices, skip, poll);
}

FacetGroups group_equal_faces(const FacesRef& faces, Index n_vertices) {
  return group(faces, kFace, n_vertices, {}, {});
}

FacetGroups group_equal_tets(const TetsRef& tets, Index n_vertices, const Poll& poll) {
  return group(tets, kTet, n_vertices, {}, poll);
}

int same_turn(const Eigen::Matrix<Index, 1, 3>& a, const Eigen::Matrix<Index, 1, 3>& b) {
  for (int k = 0; k < 3; ++k) {
    if (b[k] == a[0]) return b[(k + 1) % 3] == a[1] ? 1 : -1;
  }
  return 0;
}

}  // namespace stretchmap::mesh
