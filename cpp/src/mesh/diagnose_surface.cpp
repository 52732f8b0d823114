#include "mesh/diagnosis_common.hpp"
#include "stretchmap/mesh/diagnosis.hpp"
#include "stretchmap/mesh/size.hpp"

namespace stretchmap::mesh {
namespace {

using Pair = Eigen::Matrix<Index, 1, 2>;

// Faces that run against the majority of their patch; the first face decides a draw.
Mask minority(const Patches& patches) {
  std::vector<Index> votes(patches.count, 0);
  for (std::size_t f = 0; f < patches.turned.size(); ++f) {
    if (patches.patch[f] >= 0) votes[patches.patch[f]] += patches.turned[f] ? -1 : 1;
  }
  Mask mask(patches.turned.size(), 0);
  for (std::size_t f = 0; f < mask.size(); ++f) {
    if (patches.patch[f] < 0) continue;
    mask[f] = votes[patches.patch[f]] < 0 ? !patches.turned[f] : patches.turned[f];
  }
  return mask;
}

void orientation(const PointsRef& points, const FacesRef& faces, const FacetGroups& groups,
                 const Mask& skip, SurfaceDiagnosis& report) {
  const Patches patches = face_patches(faces, groups, skip);
  const Mask against = minority(patches);
  const Mask turn = faces_to_turn(points, faces, patches);
  Mask inside_out(faces.rows(), 0);
  for (std::size_t f = 0; f < inside_out.size(); ++f) {
    const Index p = patches.patch[f];
    inside_out[f] = p >= 0 && patches.closed[p] && turn[f] != against[f];
  }
  report.misoriented = set_entries(against);
  report.inside_out = set_entries(inside_out);
  report.conflicts = as_vector(patches.conflicts);
}

// Edges by their number of faces, and the fans of faces round each vertex.
void manifoldness(const FacesRef& faces, const FacetGroups& groups, const Mask& skip,
                  Index n_vertices, SurfaceDiagnosis& report) {
  std::vector<Pair> borders, crowded;
  DisjointSets corners(static_cast<Index>(3 * faces.rows()));
  for (Index g = 0; g < groups.size(); ++g) {
    const Index first = groups.start[g], last = groups.start[g + 1];
    const auto corner_of = [&](Index h, Index v) {
      return faces(h / 3, h % 3) == v ? h : 3 * (h / 3) + (h % 3 + 1) % 3;
    };
    const Index h = groups.order[first];
    const Index a = faces(h / 3, h % 3), b = faces(h / 3, (h + 1) % 3);
    const Pair edge{std::min(a, b), std::max(a, b)};
    if (last - first == 1) borders.push_back(edge);
    if (last - first > 2) crowded.push_back(edge);
    for (Index p = first + 1; p < last; ++p) {
      corners.unite(corner_of(h, a), corner_of(groups.order[p], a));
      corners.unite(corner_of(h, b), corner_of(groups.order[p], b));
    }
  }
  report.border_edges = as_rows<Edges>(borders);
  report.nonmanifold_edges = as_rows<Edges>(crowded);
  Mask split(n_vertices, 0);
  mark_split_corners(faces, skip, corners, split);
  report.nonmanifold_vertices = set_entries(split);
}

void topology(const FacesRef& faces, const FacetGroups& groups, const Mask& skip, Index n_vertices,
              SurfaceDiagnosis& report) {
  const Components parts = components(faces, n_vertices, skip);
  report.component = parts.element;
  report.unreferenced = negative_entries(parts.vertex);
  report.euler.setZero(parts.count);
  for (Index i = 0; i < n_vertices; ++i) {
    if (parts.vertex[i] >= 0) ++report.euler[parts.vertex[i]];
  }
  for (Index g = 0; g < groups.size(); ++g) {
    --report.euler[parts.element[groups.order[groups.start[g]] / 3]];
  }
  for (Index f = 0; f < faces.rows(); ++f) {
    if (parts.element[f] >= 0) ++report.euler[parts.element[f]];
  }
  Mask spoilt(parts.count, 0);
  for (const Edges* edges : {&report.border_edges, &report.nonmanifold_edges}) {
    for (Index e = 0; e < edges->rows(); ++e) spoilt[parts.vertex[(*edges)(e, 0)]] = 1;
  }
  for (const Index i : report.nonmanifold_vertices) spoilt[parts.vertex[i]] = 1;
  for (const Index f : report.conflicts) spoilt[parts.element[f]] = 1;
  report.genus.resize(parts.count);
  for (Index c = 0; c < parts.count; ++c) {
    report.genus[c] = spoilt[c] ? -1 : (2 - report.euler[c]) / 2;
  }
}

}  // namespace

SurfaceDiagnosis diagnose_surface(const PointsRef& points, const FacesRef& faces) {
  const Index n_vertices = static_cast<Index>(points.rows());
  SurfaceDiagnosis report;
  const LeftOut out = left_out(faces, group_equal_faces(faces, n_vertices));
  const Mask& skip = out.either;
  const auto flat = degenerate_faces(points, faces);
  Mask no_area(skip.size(), 0);
  for (std::size_t f = 0; f < skip.size(); ++f) {
    no_area[f] = !skip[f] && flat[static_cast<Index>(f)];
  }
  report.repeated = set_entries(out.repeated);
  report.duplicates = set_entries(out.copies);
  report.degenerate = set_entries(no_area);

  const FacetGroups groups = group_half_edges(faces, n_vertices, skip);
  orientation(points, faces, groups, skip, report);
  manifoldness(faces, groups, skip, n_vertices, report);
  topology(faces, groups, skip, n_vertices, report);
  return report;
}

}  // namespace stretchmap::mesh
