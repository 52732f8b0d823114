#include <algorithm>
#include <memory>

#include "stages.hpp"
#include "stretchmap/linalg/spd_solver.hpp"
#include "stretchmap/mesh/size.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"
#include "stretchmap/volume/tet_laplacian.hpp"

namespace stretchmap::bench {
namespace {

struct System {
  SparseMatrix matrix;
  Rows rhs;
};

// The harmonic map of the solid: Laplacian with the boundary eliminated, three right-hand sides.
System harmonic_system(const SolidTorus& solid) {
  const Index n = static_cast<Index>(solid.points.rows());
  Flags fixed = Flags::Zero(n);
  Points x = Points::Zero(n, 3);
  for (const Index i : mesh::tet_boundary(solid.tets, n).vertices) {
    fixed[i] = 1;
    x.row(i) = solid.standard.row(i);
  }
  volume::TetLaplacian laplacian(solid.tets, fixed, mesh::tet_volumes(solid.points, solid.tets));
  System system{laplacian.pattern(), {}};
  Points rhs;
  laplacian.assemble(solid.points, 0.0, x, system.matrix, rhs);
  system.rhs = rhs;
  return system;
}

void backend_stage(const std::string& backend, const System& system, const SolidTorus& solid,
                   const Settings& settings, const Report& report) {
  const std::string name = "linalg." + backend + ".";
  const double rows = static_cast<double>(system.matrix.rows());
  std::unique_ptr<linalg::SpdSolver> solver;
  Record row = measure(
      row_name(name + "setup", solid, settings),
      [&] {
        solver = std::make_unique<linalg::SpdSolver>(SparseMatrix(system.matrix),
                                                     linalg::SpdOptions{backend});
      },
      0.3, 5);
  row.counters = {{"rows", rows}, {"entries", double(system.matrix.nonZeros())}};
  report(row);
  row = measure(row_name(name + "refactor", solid, settings), [&] { solver->refactor(); });
  report(row);
  for (const double tol : {1e-6, 1e-10}) {
    linalg::SolveReport solved;
    Rows x;
    row = measure(row_name(name + (tol == 1e-6 ? "solve_1e-6" : "solve_1e-10"), solid, settings),
                  [&] {
                    x = Rows::Zero(system.rhs.rows(), 3);
                    solved = solver->solve(system.rhs, x, {tol});
                  });
    row.counters = {{"cg", double(solved.iterations)},
                    {"residual", solved.residual.maxCoeff()},
                    {"ns_per_row", 1e9 * row.seconds / rows}};
    report(row);
  }
}

}  // namespace

void linalg_stages(const SolidTorus& solid, const Settings& settings, const Report& report) {
  constexpr Index kLargestFactored = 40000;  // beyond it the fill takes minutes
  const System system = harmonic_system(solid);
  backend_stage("multigrid", system, solid, settings, report);
  if (system.matrix.rows() <= kLargestFactored)
    backend_stage("direct", system, solid, settings, report);
}

}  // namespace stretchmap::bench
