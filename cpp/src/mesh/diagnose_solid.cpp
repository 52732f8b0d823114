#include "mesh/diagnosis_common.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/mesh/diagnosis.hpp"
#include "stretchmap/mesh/size.hpp"

namespace stretchmap::mesh {
namespace {

using Triple = Eigen::Matrix<Index, 1, 3>;

// Whether no tet is negative and no two run against each other: then there is nothing to turn.
bool sound_orientation(const TetsRef& tets, const FacetGroups& faces, const Mask& skip,
                       const Vec& volumes) {
  const double negative = least_of(static_cast<Index>(tets.rows()), 1.0, [&](Index t) {
    return skip[t] || volumes[t] > 0.0 ? 1.0 : -1.0;
  });
  return negative > 0.0 &&
         least_of(faces.size(), 1.0, [&](Index g) {
           const Index* h = faces.order.data() + faces.start[g];
           const bool two = faces.start[g + 1] - faces.start[g] == 2;
           return two && same_turn(half_face(tets, h[0]), half_face(tets, h[1])) > 0 ? -1.0 : 1.0;
         }) > 0.0;
}

void orientation(const PointsRef& points, const TetsRef& tets, const FacetGroups& faces,
                 const Mask& skip, SolidDiagnosis& report) {
  const Vec volumes = tet_volumes(points, tets);
  const auto flat = degenerate_tets(points, tets);
  Mask turn(tets.rows(), 0), no_volume(tets.rows(), 0), folded(tets.rows(), 0);
  if (!sound_orientation(tets, faces, skip, volumes)) {
    const Patches patches = tet_patches(tets, faces, skip);
    turn = tets_to_turn(points, tets, patches);
    report.conflicts = as_vector(patches.conflicts);
  }
  for_rows(static_cast<Index>(tets.rows()), [&](Index t) {
    if (skip[t]) return;
    no_volume[t] = flat[t];
    folded[t] = !flat[t] && (turn[t] ? volumes[t] > 0 : volumes[t] < 0);
  });
  report.degenerate = set_entries(no_volume);
  report.inverted = set_entries(folded);
  report.misoriented = set_entries(turn);
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

// For every half-face the next one of its group, after the last the first; itself if it is alone.
std::vector<Index> rings_of(const FacetGroups& faces, Index n_half_faces) {
  std::vector<Index> next(static_cast<std::size_t>(n_half_faces), -1);
  for_rows(faces.size(), [&](Index g) {
    const Index first = faces.start[g], last = faces.start[g + 1];
    for (Index p = first; p < last; ++p)
      next[faces.order[p]] = faces.order[p + 1 < last ? p + 1 : first];
  });
  return next;
}

// The triangles opposite to a vertex in its tets, for every vertex.
struct Links {
  IndexVec degree;  // (n) their corners: the vertex's neighbors
  Mask sound;       // (n) whether they are a sphere, or a disk on the boundary
};

// A vertex is sound when its link is a sphere or a disk. A link in one piece is a connected
// surface, perhaps pinched, whose Euler characteristic is 2 (inside) or 1 (on the boundary) in just
// those cases, because handles and pinches only lower it.
class LinkCheck {
 public:
  LinkCheck(const TetsRef& tets, const Incidence<>& corners, const Mask& skip,
            const std::vector<Index>& next)
      : tets_(tets), corners_(corners), skip_(skip), next_(next), seen_(4 * tets.rows(), 0) {}

  Links run() {
    const Index n = corners_.size();
    Links links{IndexVec::Zero(n), Mask(static_cast<std::size_t>(n), 1)};
    for_chunks_with(
        n, kElementChunk, [&] { return std::vector<Index>(n, -1); },
        [&](Index begin, Index end, std::vector<Index>& met) {
          for (Index v = begin; v < end; ++v) {
            links.degree[v] = degree(v, met);
            links.sound[v] = sound(v, links.degree[v]);
          }
        });
    return links;
  }

 private:
  // met[w] is the last vertex that was found to have w for a neighbor.
  Index degree(Index v, std::vector<Index>& met) const {
    Index count = 0;
    met[v] = v;
    for (const Index corner : corners_[v]) {
      if (skip_[corner / 4]) continue;
      for (int k = 0; k < 4; ++k) {
        Index& last = met[tets_(corner / 4, k)];
        count += last != v;
        last = v;
      }
    }
    return count;
  }

  bool sound(Index v, Index degree) {
    Index tets = 0, faces = 0, first = -1;
    bool border = false;
    for (const Index corner : corners_[v]) {
      if (skip_[corner / 4]) continue;
      ++tets;
      first = corner;
      for (int j = 1; j < 4; ++j) {
        const Index h = beside(corner, j);
        faces += next_[h] <= h;  // one of each group
        border = border || next_[h] == h;
      }
    }
    if (tets == 0) return true;
    return degree - faces + tets == (border ? 1 : 2) && reached(v, first) == tets;
  }

  // Corners of v that hang together with one of them across faces.
  Index reached(Index v, Index first) {
    std::vector<Index> queue{first};
    seen_[first] = 1;
    for (std::size_t i = 0; i < queue.size(); ++i)
      for (int j = 1; j < 4; ++j) {
        const Index h = next_[beside(queue[i], j)];
        Index corner = h - h % 4;
        while (tets_(corner / 4, corner % 4) != v) ++corner;
        if (seen_[corner]) continue;
        seen_[corner] = 1;
        queue.push_back(corner);
      }
    return static_cast<Index>(queue.size());
  }

  // A half-face at a corner.
  static Index beside(Index corner, int j) { return corner - corner % 4 + (corner + j) % 4; }

  const TetsRef& tets_;
  const Incidence<>& corners_;
  const Mask& skip_;
  const std::vector<Index>& next_;
  Mask seen_;  // (4 k) every corner by its vertex alone
};

// Those not explained by an edge or a face of too many.
void nonmanifold_vertices(const Mask& sound, SolidDiagnosis& report) {
  Mask unsound(sound.size());
  for (std::size_t i = 0; i < sound.size(); ++i) unsound[i] = !sound[i];
  for (const Index i : report.nonmanifold_vertices) unsound[i] = 1;
  for (const auto edge : report.nonmanifold_edges.rowwise())
    for (const Index i : edge) unsound[i] = 0;
  for (const auto face : report.nonmanifold_faces.rowwise())
    for (const Index i : face) unsound[i] = 0;
  report.nonmanifold_vertices = set_entries(unsound);
}

void topology(const TetsRef& tets, const std::vector<Index>& next, const IndexVec& degree,
              const Mask& skip, SolidDiagnosis& report) {
  const Index n_vertices = static_cast<Index>(degree.size());
  const Components parts = components(tets, n_vertices, skip);
  report.component = parts.element;
  report.unreferenced = negative_entries(parts.vertex);
  report.euler.setZero(parts.count);
  IndexVec ends = IndexVec::Zero(parts.count);  // of edges
  for (Index i = 0; i < n_vertices; ++i) {
    if (parts.vertex[i] < 0) continue;
    ++report.euler[parts.vertex[i]];
    ends[parts.vertex[i]] += degree[i];
  }
  report.euler -= ends / 2;
  IndexVec faces(tets.rows());  // each at the first of its tets
  for_rows(static_cast<Index>(tets.rows()), [&](Index t) {
    faces[t] = 0;
    for (Index h = 4 * t; h < 4 * t + 4; ++h) faces[t] += next[h] <= h;
  });
  for (Index t = 0; t < tets.rows(); ++t)
    if (parts.element[t] >= 0) report.euler[parts.element[t]] += faces[t] - 1;
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
  rest();
  orientation(points, tets, faces, skip, report);
  rest();
  boundary(points, tets, faces, report);
  const std::vector<Index> next = rings_of(faces, static_cast<Index>(4 * tets.rows()));
  const Incidence<> corners = corners_at(tets, n_vertices);
  const Links links = LinkCheck(tets, corners, skip, next).run();
  nonmanifold_vertices(links.sound, report);
  rest();
  topology(tets, next, links.degree, skip, report);
  return report;
}

}  // namespace stretchmap::mesh
