#include <cmath>

#include "stages.hpp"
#include "stretchmap/area/surface_sem.hpp"
#include "stretchmap/forms/cotangent.hpp"
#include "stretchmap/forms/harmonic.hpp"
#include "stretchmap/forms/hodge.hpp"
#include "stretchmap/homology/linking.hpp"
#include "stretchmap/homology/shortest_loop.hpp"
#include "stretchmap/homology/tree_cotree.hpp"
#include "stretchmap/mesh/diagnosis.hpp"
#include "stretchmap/mesh/size.hpp"
#include "stretchmap/mesh/surface_topology.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"

namespace stretchmap::bench {
namespace {

struct Surface {
  mesh::TetBoundary boundary;
  Points points;
  Points2 turns;
  mesh::SurfaceTopology topology;
};

// How often a loop runs along u and along v.
Eigen::Vector2d windings(const homology::Loop& loop, const Points2& turns) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < loop.size(); ++k) {
    Eigen::RowVector2d step = turns.row(loop[(k + 1) % loop.size()]) - turns.row(loop[k]);
    for (int c = 0; c < 2; ++c) sum[c] += step[c] - std::round(step[c]);
  }
  return sum.array().round();
}

void mesh_stages(const SolidTorus& solid, const Settings& settings, const Report& report,
                 Surface& s) {
  const auto name = [&](const char* stage) { return row_name(stage, solid, settings); };
  const Index n = static_cast<Index>(solid.points.rows());
  Record row =
      measure(name("mesh.boundary"), [&] { s.boundary = mesh::tet_boundary(solid.tets, n); });
  row.counters = {{"faces", s.boundary.faces.rows()}};
  report(row);

  mesh::SolidDiagnosis diagnosis;
  row = measure(
      name("mesh.diagnose"), [&] { diagnosis = mesh::diagnose_solid(solid.points, solid.tets); },
      0.3, 5);
  row.counters = {
      {"tets", solid.tets.rows()},
      {"defects", diagnosis.degenerate.size() + diagnosis.misoriented.size() +
                      diagnosis.nonmanifold_faces.rows()},
      {"genus", diagnosis.boundary_genus.size() == 1 ? diagnosis.boundary_genus[0] : -1}};
  report(row);

  const Index nb = static_cast<Index>(s.boundary.vertices.size());
  s.points.resize(nb, 3);
  s.turns.resize(nb, 2);
  for (Index i = 0; i < nb; ++i) {
    s.points.row(i) = solid.points.row(s.boundary.vertices[i]);
    s.turns.row(i) = solid.turns.row(s.boundary.vertices[i]);
  }
  row = measure(name("mesh.topology"),
                [&] { s.topology = mesh::surface_topology(s.boundary.faces, nb); });
  row.counters = {{"euler", double(nb) - s.topology.edges.rows() + s.boundary.faces.rows()}};
  report(row);
}

}  // namespace

void surface_stages(const SolidTorus& solid, const Settings& settings, const Report& report) {
  const auto name = [&](const char* stage) { return row_name(stage, solid, settings); };
  Surface s;
  mesh_stages(solid, settings, report, s);
  if (!wanted(settings, "surface")) return;

  const Vec lengths = mesh::edge_lengths(s.topology, s.points);
  homology::HomologyGenerators generators;
  Record row = measure(name("homology.generators"),
                       [&] { generators = homology::tree_cotree(s.topology, lengths); });
  row.counters = {{"loops", generators.loops.size()}};
  report(row);

  homology::LinkingMatrix linking;
  row = measure(name("homology.linking"), [&] {
    linking = homology::linking_matrix(s.topology, s.points, generators.loops);
  });
  row.counters = {{"intersection", std::abs(double(linking(0, 1) - linking(1, 0)))}};
  report(row);

  homology::Loop loop;
  IndexVec target(2);
  target << 1, 0;
  row = measure(name("homology.shortest_loop"), [&] {
    loop =
        homology::shortest_loop(s.topology, lengths, generators.forms, target, generators.loops[1]);
  });
  row.counters = {{"vertices", loop.size()}};
  report(row);

  // Row 0 of the forms runs along u, row 1 along v: known here without linking numbers.
  Eigen::Matrix2d change;
  for (int k = 0; k < 2; ++k) change.col(k) = windings(generators.loops[k], s.turns);
  const IndexRows forms = change.cast<Index>() * generators.forms;
  forms::HarmonicSolution harmonic;
  Vec areas;
  row = measure(name("forms.conformal"), [&] {
    const Vec weights = forms::cotangent_weights(s.topology, s.points);
    const Index nb = static_cast<Index>(s.points.rows());
    harmonic = forms::harmonic_forms(nb, s.topology.edges, weights, forms.cast<double>());
    areas = forms::chart_areas(s.topology, harmonic.forms.row(0), harmonic.forms.row(1));
  });
  row.counters = {{"conformal_energy", std::sqrt(harmonic.gram.determinant()) - 1.0},
                  {"flips", (areas.array() <= 0.0).count()},
                  {"covers", areas.sum()}};
  report(row);

  const double aspect = std::sqrt(harmonic.gram(1, 1) / harmonic.gram(0, 0));
  const Vec face_area = mesh::face_areas(s.points, s.boundary.faces);
  const area::SurfaceChart chart = area::surface_chart(s.topology, forms);
  area::SurfaceMeasures measured;
  constexpr int kSteps = 10;
  row = measure(name("area.sem"), [&] {
    area::SurfaceSem sem(chart, face_area, aspect, Points2(harmonic.potentials));
    for (int step = 0; step < kSteps; ++step) sem.step();
    measured = sem.measures();
  });
  row.counters = {{"steps", kSteps},
                  {"energy", measured.energy},
                  {"flips", measured.flips},
                  {"ring_std", measured.ring_std},
                  {"face_std", measured.face_std}};
  report(row);
}

}  // namespace stretchmap::bench
