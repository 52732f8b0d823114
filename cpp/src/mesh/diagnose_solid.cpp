#include "mesh/diagnosis_common.hpp"
#include "stretchmap/mesh/diagnosis.hpp"
#include "stretchmap/mesh/size.hpp"

namespace stretchmap::mesh {
namespace {

using Triple = Eigen::Matrix<Index, 1, 3>;

void orientation(const PointsRef& points, const TetsRef& tets, const FacetGroups& faces,
                 const Mask& skip, SolidDiagnosis& report) {
  const Patches patches = tet_patches(tets, faces, skip);
  const Mask turn = tets_to_turn(points, tets, patches);
  const Vec volumes = tet_volumes(points, tets);
  const auto flat = degenerate_tets(points, tets);
  Mask no_volume(tets.rows(), 0), folded(tets.rows(), 0);
  for (Index t = 0; t < tets.rows(); ++t) {
    if (skip[t]) continue;
    no_volume[t] = flat[t];
    folded[t] = !flat[t] && (turn[t] ? volumes[t] > 0 : volumes[t] < 0);
  }
  report.degenerate = set_entries(no_volume);
  report.inverted = set_entries(folded);
  report.misoriented = set_entries(turn);
  report.conflicts = as_vector(patches.conflicts);
}

void boundary(const PointsRef& points, const TetsRef& tets, const FacetGroups& faces,
              SolidDiagnosis& report) {
  std::vector<Triple> crowded;
  std::vector<Index> single;
  for (Index g = 0; g < faces.size(); ++g) {
    const Index h = faces.order[faces.start[g]];
    const Index members = faces.start[g + 1] - faces.start[g];
    if (members == 1) single.push_back(h);
    if (members > 2) crowded.push_back(half_face(tets, h));
  }
  std::sort(single.begin(), single.end());
  report.nonmanifold_faces = as_rows<Faces>(crowded);
  report.boundary_faces.resize(static_cast<Index>(single.size()), 3);
  for (std::size_t f = 0; f < single.size(); ++f) {
    report.boundary_faces.row(f) = half_face(tets, single[f]);
  }
  const SurfaceDiagnosis surface = diagnose_surface(points, report.boundary_faces);
  report.boundary_component = surface.component;
  report.boundary_genus = surface.genus;
  report.nonmanifold_edges = surface.nonmanifold_edges;
  report.nonmanifold_vertices = surface.nonmanifold_vertices;
}

// The triangles opposite to a vertex in its tets, for every vertex.
struct Links {
  DisjointSets corners;  // of tets, those connected across faces round their vertex
  IndexVec euler;        // (n) Euler characteristic
  IndexVec expected;     // (n) of a sphere, or of a disk on the boundary
};

Links vertex_links(const TetsRef& tets, const FacetGroups& faces, const FacetGroups& edges,
                   const Mask& skip, Index n_vertices, const Poll& poll) {
  Links links{DisjointSets(static_cast<Index>(4 * tets.rows())), IndexVec::Zero(n_vertices),
              IndexVec::Constant(n_vertices, 2)};
  const auto corner_of = [&](Index t, Index v) {
    for (Index k = 0; k < 3; ++k) {
      if (tets(t, k) == v) return 4 * t + k;
    }
    return 4 * t + 3;
  };
  for (Index g = 0; g < faces.size(); ++g) {
    if (poll && g % 65536 == 0) poll();
    const Index first = faces.start[g], last = faces.start[g + 1];
    const Index h = faces.order[first];
    for (const Index v : half_face(tets, h)) {
      --links.euler[v];
      if (last - first == 1) links.expected[v] = 1;
      for (Index p = first + 1; p < last; ++p) {
        links.corners.unite(corner_of(h / 4, v), corner_of(faces.order[p] / 4, v));
      }
    }
  }
  for (Index t = 0; t < tets.rows(); ++t) {
    if (skip[t]) continue;
    for (int k = 0; k < 4; ++k) ++links.euler[tets(t, k)];
  }
  for (Index g = 0; g < edges.size(); ++g) {
    const Index h = edges.order[edges.start[g]];
    for (const int k : kTetEdge[h % 6]) ++links.euler[tets(h / 6, k)];
  }
  return links;
}

// A vertex is sound when its link is a sphere or a disk. It is a connected surface, perhaps
// pinched, whose Euler characteristic is 2 (inside) or 1 (on the boundary) in just those cases,
// because handles and pinches only lower it.
void nonmanifold_vertices(const TetsRef& tets, const Mask& skip, Links links,
                          SolidDiagnosis& report) {
  const Index n_vertices = static_cast<Index>(links.euler.size());
  Mask unsound(n_vertices, 0), used(n_vertices, 0);
  mark_split_corners(tets, skip, links.corners, unsound);
  for (Index t = 0; t < tets.rows(); ++t) {
    for (int k = 0; k < 4 && !skip[t]; ++k) used[tets(t, k)] = 1;
  }
  for (Index i = 0; i < n_vertices; ++i)
    unsound[i] |= used[i] && links.euler[i] != links.expected[i];
  for (const Index i : report.nonmanifold_vertices) unsound[i] = 1;
  for (const auto edge : report.nonmanifold_edges.rowwise())
    for (const Index i : edge) unsound[i] = 0;
  for (const auto face : report.nonmanifold_faces.rowwise())
    for (const Index i : face) unsound[i] = 0;
  report.nonmanifold_vertices = set_entries(unsound);
}

void topology(const TetsRef& tets, const FacetGroups& faces, const FacetGroups& edges,
              const Mask& skip, Index n_vertices, SolidDiagnosis& report) {
  const Components parts = components(tets, n_vertices, skip);
  report.component = parts.element;
  report.unreferenced = negative_entries(parts.vertex);
  report.euler.setZero(parts.count);
  for (Index i = 0; i < n_vertices; ++i) {
    if (parts.vertex[i] >= 0) ++report.euler[parts.vertex[i]];
  }
  for (Index g = 0; g < edges.size(); ++g) {
    --report.euler[parts.element[edges.order[edges.start[g]] / 6]];
  }
  for (Index g = 0; g < faces.size(); ++g) {
    ++report.euler[parts.element[faces.order[faces.start[g]] / 4]];
  }
  for (Index t = 0; t < tets.rows(); ++t) {
    if (parts.element[t] >= 0) --report.euler[parts.element[t]];
  }
}

}  // namespace

SolidDiagnosis diagnose_solid(const PointsRef& points, const TetsRef& tets, const Poll& poll) {
  const auto rest = [&] {
    if (poll) poll();
  };
  const Index n_vertices = static_cast<Index>(points.rows());
  SolidDiagnosis report;
  const LeftOut out = left_out(tets, group_equal_tets(tets, n_vertices, poll));
  const Mask& skip = out.either;
  report.repeated = set_entries(out.repeated);
  report.duplicates = set_entries(out.copies);

  const FacetGroups faces = group_half_faces(tets, n_vertices, skip, poll);
  const FacetGroups edges = group_tet_edges(tets, n_vertices, skip, poll);
  rest();
  orientation(points, tets, faces, skip, report);
  rest();
  boundary(points, tets, faces, report);
  nonmanifold_vertices(tets, skip, vertex_links(tets, faces, edges, skip, n_vertices, poll),
                       report);
  rest();
  topology(tets, faces, edges, skip, n_vertices, report);
  return report;
}

}  // namespace stretchmap::mesh
