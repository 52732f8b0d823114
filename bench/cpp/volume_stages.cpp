#include <algorithm>
#include <cmath>
#include <memory>

#include "stages.hpp"
#include "stretchmap/measures/element_measures.hpp"
#include "stretchmap/mesh/size.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"
#include "stretchmap/volume/rest_shape.hpp"
#include "stretchmap/volume/solid_newton.hpp"
#include "stretchmap/volume/volumetric_stretch.hpp"

namespace stretchmap::bench {
namespace {

struct Problem {
  Flags fixed;
  Vec rest;  // volumes, total one
  Points V;  // source of total volume one
  Points x;  // boundary rows on the torus, the others zero
  double r, R;
};

Problem make_problem(const SolidTorus& solid) {
  Problem p;
  const Index n = static_cast<Index>(solid.points.rows());
  p.rest = mesh::tet_volumes(solid.points, solid.tets);
  const double scale = 1.0 / std::cbrt(p.rest.sum());
  p.rest /= p.rest.sum();
  p.V = solid.points * scale;
  p.x = Points::Zero(n, 3);
  p.fixed = Flags::Zero(n);
  const mesh::TetBoundary boundary = mesh::tet_boundary(solid.tets, n);
  for (const Index i : boundary.vertices) {
    p.fixed[i] = 1;
    p.x.row(i) = scale * solid.standard.row(i);
  }
  p.R = scale * solid.R;
  p.r = scale * solid.r;
  return p;
}

struct Quality {
  double energy;
  double flips;
};

Quality quality(const Points& x, const Tets& tets, const Vec& rest) {
  const Vec volumes = mesh::tet_volumes(x, tets);
  return {volume::tet_stretch_energy(volumes, rest), double((volumes.array() <= 0.0).count())};
}

// What any assembly has to move: the tets, their volumes and positions once each, the values of the
// matrix and the right-hand sides written once.
double assembly_bytes(double tets, double vertices, double entries, double rows) {
  return tets * (4 * sizeof(Index) + sizeof(double)) + vertices * 3 * sizeof(double) +
         entries * sizeof(double) + rows * 3 * sizeof(double);
}

void assembly_stage(const SolidTorus& solid, const Problem& p, const Settings& settings,
                    const Report& report) {
  std::unique_ptr<volume::TetLaplacian> laplacian;
  Record row = measure(
      row_name("volume.pattern", solid, settings),
      [&] { laplacian = std::make_unique<volume::TetLaplacian>(solid.tets, p.fixed, p.rest); }, 0.3,
      3);
  SparseMatrix matrix = laplacian->pattern();
  row.counters = {{"rows", matrix.rows()}, {"entries", matrix.nonZeros()}};
  report(row);

  Points rhs;
  row = measure(row_name("volume.assemble", solid, settings),
                [&] { laplacian->assemble(p.V, settings.c, p.x, matrix, rhs); });
  const double bytes =
      assembly_bytes(solid.tets.rows(), p.V.rows(), matrix.nonZeros(), matrix.rows());
  const double with_indices = bytes + laplacian->index_bytes();
  const auto share = [&](double moved) {
    return settings.bandwidth > 0.0 ? moved / row.seconds / settings.bandwidth : 0.0;
  };
  row.counters = {{"bytes", bytes},
                  {"bytes_per_second", bytes / row.seconds},
                  {"bandwidth_share", share(bytes)},
                  {"bytes_with_indices", with_indices},
                  {"bandwidth_share_with_indices", share(with_indices)},
                  {"trace", matrix.diagonal().sum()},
                  {"ns_per_tet", 1e9 * row.seconds / solid.tets.rows()}};
  report(row);
}

void vsem_stages(const SolidTorus& solid, const Problem& p, const Settings& settings,
                 const Report& report, Points& x) {
  linalg::SolveOptions options;
  options.tol = 1e-8;
  options.max_iter = 1000;
  volume::VolumetricStretch stretch(solid.tets, p.fixed, p.rest, "auto");
  x = p.x;
  linalg::SolveReport solved;
  Record row = measure(
      row_name("volume.harmonic", solid, settings),
      [&] { solved = stretch.harmonic(p.V, x, options); }, 0.0, 1);
  Quality q = quality(x, solid.tets, p.rest);
  row.counters = {{"energy", q.energy},
                  {"flips", q.flips},
                  {"residual", solved.residual.maxCoeff()},
                  {"cg", solved.iterations}};
  report(row);

  double residual = 0.0, cg = 0.0;
  row = measure(
      row_name("volume.vsem", solid, settings),
      [&] {
        for (int step = 0; step < settings.vsem_steps; ++step) {
          solved = stretch.step(x, settings.c, true, options);
          residual = std::max(residual, solved.residual.maxCoeff());
          cg += solved.iterations;
        }
      },
      0.0, 1);
  q = quality(x, solid.tets, p.rest);
  row.counters = {
      {"steps", settings.vsem_steps},
      {"c", settings.c},
      {"energy", q.energy},
      {"flips", q.flips},
      {"residual", residual},
      {"cg", cg},
      {"ns_per_tet_step", 1e9 * row.seconds / std::max(1, settings.vsem_steps) / solid.tets.rows()},
      {"peak_bytes_per_tet", peak_resident_bytes() / solid.tets.rows()}};
  report(row);

  measures::ElementMeasures measures;
  row = measure(row_name("distortion.tets", solid, settings),
                [&] { measures = measures::tet_measures(p.V, solid.tets, x); });
  row.counters = {{"image_volume", measures.image.sum()}};
  report(row);
}

// From the standard torus itself, which is free of flips: how fast a step is does not depend on
// where it starts.
void newton_stages(const SolidTorus& solid, const Problem& p, const Settings& settings,
                   const Report& report) {
  Points x = solid.standard * (p.R / solid.R);
  std::unique_ptr<volume::SolidNewton> newton;
  Record row = measure(
      row_name("newton.setup", solid, settings),
      [&] {
        newton = std::make_unique<volume::SolidNewton>(volume::SolidEnergy(
            {solid.tets, volume::rest_matrices(p.V, solid.tets, 6.0), p.rest, p.fixed}, x));
      },
      0.0, 1);
  row.counters = {{"rows", newton->energy().rows()}};
  report(row);

  volume::EnergyWeights weights;
  weights.volume = 10.0;
  volume::NewtonOptions options;
  options.tol = 0.1;
  volume::NewtonReport last;
  double cg = 0.0, first = 0.0;
  row = measure(
      row_name("newton.steps", solid, settings),
      [&] {
        for (int step = 0; step < settings.newton_steps; ++step) {
          last = newton->step(x, weights, options);
          if (step == 0) first = last.before.energy;
          cg += last.cg_iterations;
        }
      },
      0.0, 1);
  row.counters = {
      {"steps", settings.newton_steps},
      {"energy_before", first},
      {"energy", last.after.energy},
      {"flips", last.after.flips},
      {"min_det", last.after.min_det},
      {"residual", last.cg_residual},
      {"cg", cg},
      {"ns_per_tet_step", 1e9 * row.seconds / settings.newton_steps / solid.tets.rows()},
      {"peak_bytes_per_tet", peak_resident_bytes() / solid.tets.rows()}};
  report(row);
}

}  // namespace

void volume_stages(const SolidTorus& solid, const Settings& settings, const Report& report) {
  const Problem p = make_problem(solid);
  if (wanted(settings, "volume")) {
    assembly_stage(solid, p, settings, report);
    Points x;
    vsem_stages(solid, p, settings, report, x);
  }
  if (wanted(settings, "newton") && settings.newton_steps > 0)
    newton_stages(solid, p, settings, report);
}

}  // namespace stretchmap::bench
