#include "stretchmap/area/surface_patch.hpp"

namespace stretchmap::area {

SurfacePatch surface_patch(const GlideProblem& problem, const std::vector<Index>& faces,
                           int rings) {
  const SurfaceChart& chart = problem.chart;
  const Index m = static_cast<Index>(chart.faces.rows());
  Flags free = Flags::Zero(chart.n_vertices), inside = Flags::Zero(m);
  for (const Index f : faces)
    for (int k = 0; k < 3; ++k) free(chart.faces(f, k)) = 1;
  const auto touched = [&](Index f) {
    return free(chart.faces(f, 0)) || free(chart.faces(f, 1)) || free(chart.faces(f, 2));
  };
  for (int ring = 0; ring < rings; ++ring) {
    if (ring)
      for (Index f = 0; f < m; ++f)
        if (inside(f))
          for (int k = 0; k < 3; ++k) free(chart.faces(f, k)) = 1;
    for (Index f = 0; f < m; ++f) inside(f) = touched(f);
  }

  SurfacePatch patch;
  const Index n_faces = inside.cast<Index>().sum();
  patch.problem.ratio = problem.ratio;
  SurfaceChart& part = patch.problem.chart;
  SurfaceReference& reference = patch.problem.reference;
  part.faces.resize(n_faces, 3);
  part.shift_u.resize(n_faces, 3);
  part.shift_v.resize(n_faces, 3);
  reference.areas.resize(n_faces);
  reference.weights.resize(n_faces);
  reference.cotan.resize(n_faces, 3);
  IndexVec row = IndexVec::Constant(chart.n_vertices, -1);
  std::vector<Index> vertices;
  Index next = 0;
  for (Index f = 0; f < m; ++f) {
    if (!inside(f)) continue;
    for (int k = 0; k < 3; ++k) {
      const Index i = chart.faces(f, k);
      if (row(i) < 0) {
        row(i) = static_cast<Index>(vertices.size());
        vertices.push_back(i);
      }
      part.faces(next, k) = row(i);
    }
    part.shift_u.row(next) = chart.shift_u.row(f);
    part.shift_v.row(next) = chart.shift_v.row(f);
    reference.areas(next) = problem.reference.areas(f);
    reference.weights(next) = problem.reference.weights(f);
    reference.cotan.row(next) = problem.reference.cotan.row(f);
    ++next;
  }
  part.n_vertices = static_cast<Index>(vertices.size());
  patch.vertices = Eigen::Map<const IndexVec>(vertices.data(), part.n_vertices);
  patch.held = Flags::Zero(part.n_vertices);
  for (Index f = 0; f < m; ++f)
    if (!inside(f))
      for (int k = 0; k < 3; ++k)
        if (const Index i = row(chart.faces(f, k)); i >= 0) patch.held(i) = 1;
  return patch;
}

}  // namespace stretchmap::area
