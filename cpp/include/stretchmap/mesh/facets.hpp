// Groups of equal facets: which half-edges share an edge, which half-faces share a face.
//
// Half-face 4 t + i is the face of tet t opposite its corner i, with its corners listed so that it
// points out of a positively oriented tet. Tet edge 6 t + j joins the corners kTetEdge[j].
#pragma once

#include <vector>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/types.hpp"

namespace stretchmap::mesh {

inline constexpr int kTetFace[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
inline constexpr int kTetEdge[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

struct FacetGroups {
  // Facets, equal ones side by side; groups in lexicographic order of their sorted vertex ids,
  // members in ascending order.
  Buffer<Index> order;
  Buffer<Index> start;  // (g + 1) where each group begins in `order`
  Index size() const { return static_cast<Index>(start.size()) - 1; }
};

// One entry per element; empty means that no element is skipped.
using Mask = std::vector<char>;

// \param skip elements with a set mask are left out.
FacetGroups group_half_edges(const FacesRef& faces, Index n_vertices, const Mask& skip = {},
                             const Poll& poll = {});
FacetGroups group_half_faces(const TetsRef& tets, Index n_vertices, const Mask& skip = {},
                             const Poll& poll = {});
FacetGroups group_tet_edges(const TetsRef& tets, Index n_vertices, const Mask& skip = {},
                            const Poll& poll = {});
// Whole elements with the same vertex set.
FacetGroups group_equal_faces(const FacesRef& faces, Index n_vertices);
FacetGroups group_equal_tets(const TetsRef& tets, Index n_vertices, const Poll& poll = {});

// \return vertices of half-face h, in its outward order.
inline Eigen::Matrix<Index, 1, 3> half_face(const TetsRef& tets, Index h) {
  const int* corner = kTetFace[h % 4];
  const Index t = h / 4;
  return {tets(t, corner[0]), tets(t, corner[1]), tets(t, corner[2])};
}

// \return +1 when two triples with the same three vertices run round the triangle the same way,
// else
//         -1.
int same_turn(const Eigen::Matrix<Index, 1, 3>& a, const Eigen::Matrix<Index, 1, 3>& b);

}  // namespace stretchmap::mesh
