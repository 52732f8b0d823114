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

// Groups found from one chunk of vertices: those of which they are the lowest.
struct Part {
  std::vector<Index> order, start;
};

FacetGroups joined(std::vector<Part>& parts) {
  std::vector<std::array<std::size_t, 2>> place{{0, 0}};
  for (const Part& part : parts)
    place.push_back({place.back()[0] + part.order.size(), place.back()[1] + part.start.size()});
  FacetGroups groups;
  groups.order.resize(place.back()[0]);
  groups.start.resize(place.back()[1] + 1);
  for_tasks(static_cast<Index>(parts.size()), [&](Index p) {
    const auto [order, start] = place[p];
    std::copy(parts[p].order.begin(), parts[p].order.end(), groups.order.begin() + order);
    std::transform(parts[p].start.begin(), parts[p].start.end(), groups.start.begin() + start,
                   [first = order](Index at) { return at + static_cast<Index>(first); });
    parts[p] = Part();
  });
  groups.start.back() = static_cast<Index>(groups.order.size());
  return groups;
}

// Facet F e + j of element e has the element's corners facet[j]. A facet is found from its lowest
// vertex; a short sort there brings equal ones together.
template <class Elements, int F, int N>
FacetGroups group(const Elements& elements, const int (&facet)[F][N], const Incidence<>& corners,
                  const Mask& skip, const Poll& poll) {
  const Index width = static_cast<Index>(elements.cols());
  const auto gather = [&](Index vertex, std::vector<Key<N>>& keys) {
    keys.clear();
    for (const Index corner : corners[vertex]) {
      const Index e = corner / width, k = corner % width;
      if (!skip.empty() && skip[e]) continue;
      Index lower = 0;  // corners, which a facet from here has to leave out
      for (Index i = 0; i < width; ++i) lower += elements(e, i) < vertex;
      if (lower > width - N) continue;
      for (int j = 0; j < F; ++j) {
        std::array<Index, N> ids;
        int least = 0;
        for (int i = 0; i < N; ++i) {
          ids[i] = elements(e, facet[j][i]);
          if (ids[i] < ids[least]) least = i;
        }
        if (facet[j][least] != k) continue;
        std::sort(ids.begin(), ids.end());
        keys.emplace_back(ids, F * e + j);
      }
    }
    std::sort(keys.begin(), keys.end());
  };
  const Index n = corners.size();
  std::vector<Part> parts(static_cast<std::size_t>(chunk_count(n, kElementChunk)));
  for (Index first = 0; first < n; first += kBetweenPolls) {
    if (poll) poll();
    for_chunks_with(
        std::min(kBetweenPolls, n - first), kElementChunk, [] { return std::vector<Key<N>>(); },
        [&](Index begin, Index end, std::vector<Key<N>>& keys) {
          Part& part = parts[(first + begin) / kElementChunk];
          for (Index i = first + begin; i < first + end; ++i) {
            gather(i, keys);
            for (std::size_t p = 0; p < keys.size(); ++p) {
              if (p == 0 || !keys[p].same(keys[p - 1]))
                part.start.push_back(static_cast<Index>(part.order.size()));
              part.order.push_back(keys[p].facet);
            }
          }
        });
  }
  return joined(parts);
}

}  // namespace

FacetGroups group_half_edges(const FacesRef& faces, const Incidence<>& corners, const Mask& skip,
                             const Poll& poll) {
  return group(faces, kHalfEdge, corners, skip, poll);
}

FacetGroups group_half_faces(const TetsRef& tets, const Incidence<>& corners, const Mask& skip,
                             const Poll& poll) {
  return group(tets, kTetFace, corners, skip, poll);
}

FacetGroups group_tet_edges(const TetsRef& tets, const Incidence<>& corners, const Mask& skip,
                            const Poll& poll) {
  return group(tets, kTetEdge, corners, skip, poll);
}

FacetGroups group_equal_faces(const FacesRef& faces, const Incidence<>& corners) {
  return group(faces, kFace, corners, {}, {});
}

FacetGroups group_equal_tets(const TetsRef& tets, const Incidence<>& corners, const Poll& poll) {
  return group(tets, kTet, corners, {}, poll);
}

int same_turn(const Eigen::Matrix<Index, 1, 3>& a, const Eigen::Matrix<Index, 1, 3>& b) {
  for (int k = 0; k < 3; ++k) {
    if (b[k] == a[0]) return b[(k + 1) % 3] == a[1] ? 1 : -1;
  }
  return 0;
}

}  // namespace stretchmap::mesh
