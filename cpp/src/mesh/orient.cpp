#include "stretchmap/mesh/orient.hpp"

#include <algorithm>
#include <utility>

#include "mesh/diagnosis_common.hpp"
#include "stretchmap/mesh/size.hpp"

namespace stretchmap::mesh {
namespace {

// Union-find in which every element knows whether it agrees with its root.
class SignedSets {
 public:
  explicit SignedSets(Index n) : parent_(n), odd_(n, 0) {
    for (Index i = 0; i < n; ++i) parent_[i] = i;
  }
  std::pair<Index, char> find(Index i) {
    Index root = i;
    char odd = 0;
    for (; parent_[root] != root; root = parent_[root]) odd ^= odd_[root];
    for (char rest = odd; parent_[i] != root && i != root;) {
      const Index up = parent_[i];
      const char step = odd_[i];
      parent_[i] = root;
      odd_[i] = rest;
      rest ^= step;
      i = up;
    }
    return {root, odd};
  }
  // False when the two are linked already and the other way round.
  bool link(Index a, Index b, bool against) {
    auto [ra, pa] = find(a);
    auto [rb, pb] = find(b);
    if (ra == rb) return (pa != pb) == against;
    if (rb < ra) std::swap(ra, rb);
    parent_[rb] = ra;  // the lowest element is the root
    odd_[rb] = static_cast<char>(pa ^ pb ^ (against ? 1 : 0));
    return true;
  }

 private:
  std::vector<Index> parent_;
  std::vector<char> odd_;
};

// `against(a, b)`: do two half-facets show that their elements are oppositely oriented?
template <class Against>
Patches patches_of(Index n, int facets_per_element, const FacetGroups& groups, const Mask& skip,
                   Against against) {
  Patches result;
  SignedSets sets(n);
  std::vector<char> bordered(n, 0);
  for (Index g = 0; g < groups.size(); ++g) {
    const Index* facet = groups.order.data() + groups.start[g];
    const Index members = groups.start[g + 1] - groups.start[g];
    if (members == 2) {
      const Index a = facet[0] / facets_per_element, b = facet[1] / facets_per_element;
      if (!sets.link(a, b, against(facet[0], facet[1]))) {
        result.conflicts.push_back(a);
        result.conflicts.push_back(b);
      }
    } else {
      for (Index k = 0; k < members; ++k) bordered[facet[k] / facets_per_element] = 1;
    }
  }
  std::sort(result.conflicts.begin(), result.conflicts.end());
  result.conflicts.erase(std::unique(result.conflicts.begin(), result.conflicts.end()),
                         result.conflicts.end());
  result.patch.setConstant(n, -1);
  result.turned.assign(n, 0);
  for (Index e = 0; e < n; ++e) {
    if (!skip.empty() && skip[e]) continue;
    const auto [root, odd] = sets.find(e);
    if (root == e) {
      result.patch[e] = result.count++;
      result.closed.push_back(1);
    }
    result.patch[e] = result.patch[root];
    result.turned[e] = odd;
    if (bordered[e]) result.closed[result.patch[e]] = 0;
  }
  return result;
}

Mask turn_patches(const Patches& patches, const std::vector<double>& votes) {
  Mask turn(patches.turned.size(), 0);
  for (std::size_t e = 0; e < turn.size(); ++e) {
    const Index p = patches.patch[e];
    if (p >= 0) turn[e] = static_cast<char>(patches.turned[e] ^ (votes[p] < 0 ? 1 : 0));
  }
  return turn;
}

}  // namespace

Patches face_patches(const FacesRef& faces, const FacetGroups& half_edges, const Mask& skip) {
  return patches_of(static_cast<Index>(faces.rows()), 3, half_edges, skip,
                    [&](Index a, Index b) { return faces(a / 3, a % 3) == faces(b / 3, b % 3); });
}

Patches tet_patches(const TetsRef& tets, const FacetGroups& half_faces, const Mask& skip) {
  return patches_of(static_cast<Index>(tets.rows()), 4, half_faces, skip, [&](Index a, Index b) {
    return same_turn(half_face(tets, a), half_face(tets, b)) > 0;
  });
}

Mask faces_to_turn(const PointsRef& points, const FacesRef& faces, const Patches& patches) {
  const Eigen::RowVector3d center = points.colwise().mean();
  std::vector<double> votes(patches.count, 0);
  for (Index f = 0; f < faces.rows(); ++f) {
    const Index p = patches.patch[f];
    if (p < 0) continue;
    double vote = 1;
    if (patches.closed[p]) {
      const Eigen::RowVector3d a = points.row(faces(f, 0)) - center;
      const Eigen::RowVector3d b = points.row(faces(f, 1)) - center;
      vote = a.cross(b).dot(points.row(faces(f, 2)) - center);
    }
    votes[p] += patches.turned[f] ? -vote : vote;
  }
  return turn_patches(patches, votes);
}

Mask tets_to_turn(const PointsRef& points, const TetsRef& tets, const Patches& patches) {
  const Vec volumes = tet_volumes(points, tets);
  std::vector<double> votes(patches.count, 0);
  for (Index t = 0; t < tets.rows(); ++t) {
    const Index p = patches.patch[t];
    if (p >= 0) votes[p] += patches.turned[t] ? -volumes[t] : volumes[t];
  }
  return turn_patches(patches, votes);
}

IndexVec misoriented_faces(const PointsRef& points, const FacesRef& faces) {
  const Index n = static_cast<Index>(points.rows());
  const Mask skip = left_out(faces, group_equal_faces(faces, n)).either;
  const Patches patches = face_patches(faces, group_half_edges(faces, n, skip), skip);
  return set_entries(faces_to_turn(points, faces, patches));
}

IndexVec misoriented_tets(const PointsRef& points, const TetsRef& tets) {
  const Index n = static_cast<Index>(points.rows());
  const Mask skip = left_out(tets, group_equal_tets(tets, n)).either;
  const Patches patches = tet_patches(tets, group_half_faces(tets, n, skip), skip);
  return set_entries(tets_to_turn(points, tets, patches));
}

IndexVec set_entries(const Mask& mask) {
  IndexVec entries(std::count_if(mask.begin(), mask.end(), [](char m) { return m != 0; }));
  Index k = 0;
  for (std::size_t e = 0; k < entries.size(); ++e)
    if (mask[e]) entries[k++] = static_cast<Index>(e);
  return entries;
}

}  // namespace stretchmap::mesh
