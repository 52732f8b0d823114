#include "support/shapes.hpp"

#include <cmath>
#include <random>

#include "solid_torus.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"

namespace stretchmap::tests {
namespace {

const double kTwoPi = 2.0 * std::acos(-1.0);

Faces grid_faces(int nu, int nv) {
  Faces faces(2 * nu * nv, 3);
  Index at = 0;
  for (int i = 0; i < nu; ++i) {
    for (int j = 0; j < nv; ++j) {
      const Index a = i * nv + j, b = (i + 1) % nu * nv + j;
      const Index c = (i + 1) % nu * nv + (j + 1) % nv, d = i * nv + (j + 1) % nv;
      faces.row(at++) << a, b, c;
      faces.row(at++) << a, c, d;
    }
  }
  return faces;
}

// Integer forms of coordinates given in turns on vertices whose neighbors are close.
IndexRows forms_of(const mesh::SurfaceTopology& topology, const Points2& turns) {
  IndexRows forms(2, topology.edges.rows());
  for (Index e = 0; e < forms.cols(); ++e) {
    const Eigen::RowVector2d change =
        turns.row(topology.edges(e, 1)) - turns.row(topology.edges(e, 0));
    for (int k = 0; k < 2; ++k) forms(k, e) = -static_cast<Index>(std::lround(change[k]));
  }
  return forms;
}

}  // namespace

Points random_points(Index n, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  Points points(n, 3);
  for (Index i = 0; i < points.size(); ++i) points.data()[i] = normal(engine);
  return points;
}

WavyTorus wavy_torus(int nu, int nv, double waves) {
  WavyTorus out;
  const Index n = nu * nv;
  out.points.resize(n, 3);
  Points2 grid(n, 2);
  const Points noise = random_points(n, 5);
  for (int i = 0; i < nu; ++i) {
    for (int j = 0; j < nv; ++j) {
      const Index k = i * nv + j;
      grid.row(k) << double(i) / nu, double(j) / nv;
      const double u = kTwoPi * grid(k, 0), v = kTwoPi * grid(k, 1);
      const double swell = 1.0 + waves * std::sin(3.0 * u) * std::cos(2.0 * v);
      const double rho = 2.2 + swell * std::cos(v);
      out.points.row(k) << rho * std::cos(u), rho * std::sin(u), swell * std::sin(v);
    }
  }
  out.topology = mesh::surface_topology(grid_faces(nu, nv), n);
  out.chart = area::surface_chart(out.topology, forms_of(out.topology, grid));
  out.turns = grid + 0.1 / (nu + nv) * noise.leftCols<2>();
  return out;
}

Solid solid_torus(Index n_tets) {
  const bench::SolidTorus torus = bench::solid_torus(n_tets);
  const Index n = static_cast<Index>(torus.points.rows());
  Solid out{torus.points, torus.standard, torus.tets, Flags::Zero(n)};
  const mesh::TetBoundary boundary = mesh::tet_boundary(torus.tets, n);
  for (const Index i : boundary.vertices) out.boundary[i] = 1;
  // The generator scales to equal volumes: a boundary vertex tells by how much.
  const Index i = boundary.vertices[0];
  const double v = kTwoPi * torus.turns(i, 1);
  out.points *= (Solid::R + Solid::r * std::cos(v)) / out.points.row(i).head<2>().norm();
  return out;
}

}  // namespace stretchmap::tests
