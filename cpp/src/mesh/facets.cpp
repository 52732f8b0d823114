#include "stretchmap/mesh/facets.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::mesh {
namespace {

constexpr Index kBetweenPolls = 65536;  // vertices

// All but the lowest vertex of a facet in ascending order, packed, and the facet.
template <std::size_t N>
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

// corners(facet) returns the ids of a facet in any order; `used(facet)` says whether it counts.
// Counting sort by the lowest id, then a short sort inside each bucket.
template <std::size_t N, class Corners, class Used>
FacetGroups group(Index n_facets, Index n_vertices, Corners corners, Used used, const Poll& poll) {
  const auto now_and_then = [&](Index i, Index period) {
    if (poll && i % period == 0) poll();
  };
  std::vector<Index> bucket(static_cast<std::size_t>(n_vertices) + 1, 0);
  for (Index h = 0; h < n_facets; ++h) {
    now_and_then(h, 262144);
    if (!used(h)) continue;
    const std::array<Index, N> c = corners(h);
    ++bucket[*std::min_element(c.begin(), c.end()) + 1];
  }
  for (Index i = 0; i < n_vertices; ++i) bucket[i + 1] += bucket[i];
  std::vector<Key<N>> keys(bucket[n_vertices]);
  std::vector<Index> cursor(bucket.begin(), bucket.end() - 1);
  for (Index h = 0; h < n_facets; ++h) {
    now_and_then(h, 262144);
    if (!used(h)) continue;
    std::array<Index, N> c = corners(h);
    std::sort(c.begin(), c.end());
    keys[cursor[c[0]]++] = Key<N>(c, h);
  }
  FacetGroups groups;
  groups.order.resize(keys.size());
  groups.start.reserve(keys.size() / 2 + 1);
  std::vector<std::vector<Index>> starts(chunk_count(kBetweenPolls, kElementChunk));
  for (Index first = 0; first < n_vertices; first += kBetweenPolls) {
    if (poll) poll();
    const Index count = std::min(kBetweenPolls, n_vertices - first);
    for_chunks(count, kElementChunk, [&](Index begin, Index end) {
      std::vector<Index>& start = starts[begin / kElementChunk];
      start.clear();
      for (Index i = first + begin; i < first + end; ++i) {
        std::sort(keys.begin() + bucket[i], keys.begin() + bucket[i + 1]);
        for (Index p = bucket[i]; p < bucket[i + 1]; ++p) {
          if (p == bucket[i] || !keys[p].same(keys[p - 1])) start.push_back(p);
          groups.order[p] = keys[p].facet;
        }
      }
    });
    for (Index c = 0; c < chunk_count(count, kElementChunk); ++c)
      groups.start.insert(groups.start.end(), starts[c].begin(), starts[c].end());
  }
  groups.start.push_back(static_cast<Index>(keys.size()));
  return groups;
}

}  // namespace

FacetGroups group_half_edges(const FacesRef& faces, Index n_vertices, const Mask& skip,
                             const Poll& poll) {
  return group<2>(
      static_cast<Index>(3 * faces.rows()), n_vertices,
      [&](Index h) {
        return std::array<Index, 2>{faces(h / 3, h % 3), faces(h / 3, (h + 1) % 3)};
      },
      [&](Index h) { return skip.empty() || !skip[h / 3]; }, poll);
}

FacetGroups group_half_faces(const TetsRef& tets, Index n_vertices, const Mask& skip,
                             const Poll& poll) {
  return group<3>(
      static_cast<Index>(4 * tets.rows()), n_vertices,
      [&](Index h) {
        const auto f = half_face(tets, h);
        return std::array<Index, 3>{f[0], f[1], f[2]};
      },
      [&](Index h) { return skip.empty() || !skip[h / 4]; }, poll);
}

FacetGroups group_tet_edges(const TetsRef& tets, Index n_vertices, const Mask& skip,
                            const Poll& poll) {
  return group<2>(
      static_cast<Index>(6 * tets.rows()), n_vertices,
      [&](Index h) {
        const int* corner = kTetEdge[h % 6];
        return std::array<Index, 2>{tets(h / 6, corner[0]), tets(h / 6, corner[1])};
      },
      [&](Index h) { return skip.empty() || !skip[h / 6]; }, poll);
}

FacetGroups group_equal_faces(const FacesRef& faces, Index n_vertices) {
  return group<3>(
      static_cast<Index>(faces.rows()), n_vertices,
      [&](Index f) {
        return std::array<Index, 3>{faces(f, 0), faces(f, 1), faces(f, 2)};
      },
      [](Index) { return true; }, {});
}

FacetGroups group_equal_tets(const TetsRef& tets, Index n_vertices, const Poll& poll) {
  return group<4>(
      static_cast<Index>(tets.rows()), n_vertices,
      [&](Index t) {
        return std::array<Index, 4>{tets(t, 0), tets(t, 1), tets(t, 2), tets(t, 3)};
      },
      [](Index) { return true; }, poll);
}

int same_turn(const Eigen::Matrix<Index, 1, 3>& a, const Eigen::Matrix<Index, 1, 3>& b) {
  for (int k = 0; k < 3; ++k) {
    if (b[k] == a[0]) return b[(k + 1) % 3] == a[1] ? 1 : -1;
  }
  return 0;
}

}  // namespace stretchmap::mesh
