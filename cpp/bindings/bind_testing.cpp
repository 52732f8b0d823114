#include "arrays.hpp"
#include "solves.hpp"
#include "stretchmap/area/chart.hpp"
#include "stretchmap/area/surface_newton.hpp"
#include "stretchmap/area/surface_reference.hpp"
#include "stretchmap/area/surface_stretch.hpp"
#include "stretchmap/base/predicates.hpp"
#include "stretchmap/forms/cotangent.hpp"
#include "stretchmap/forms/hodge.hpp"
#include "stretchmap/homology/linking.hpp"
#include "stretchmap/linalg/block_solver.hpp"
#include "stretchmap/mesh/facets.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"
#include "stretchmap/volume/tet_laplacian.hpp"

namespace stretchmap::testing {
namespace {

void bind_mesh(py::module_& m) {
  m.def("orient3d", &orient3d, py::arg("a"), py::arg("b"), py::arg("c"), py::arg("d"));
  m.def("orient2d", &orient2d, py::arg("a"), py::arg("b"), py::arg("c"), py::arg("axis"));
  m.def(
      "tet_neighbors",
      [](const TetsRef& tets, Index n) { return mesh::tet_neighbors(tets, n, signal_poll()); },
      py::arg("tets").noconvert(), py::arg("n_vertices"), release_gil());
}

void bind_forms(py::module_& m) {
  m.def("weighted_laplacian", &forms::weighted_laplacian, py::arg("topology"), py::arg("weights"),
        release_gil());
  m.def("form_vectors", &forms::form_vectors, py::arg("topology"), py::arg("points").noconvert(),
        py::arg("form"), release_gil());
  m.def(
      "linking_number",
      [](const PointsRef& p, const PointsRef& q) {
        return homology::linking_number(p, q, signal_poll());
      },
      py::arg("p"), py::arg("q"), release_gil());
}

void bind_linalg(py::module_& m) {
  py::class_<linalg::BlockSolver>(m, "BlockSolver")
      .def(py::init([](const IndexVecRef& row_ptr, const IndexVecRef& col, const VecRef& values,
                       const RowsRef& near_nullspace, const std::string& preconditioner,
                       bool ordered) {
             return linalg::BlockSolver(linalg::BlockMatrix{row_ptr, col, values}, near_nullspace,
                                        linalg::BlockOptions{preconditioner, ordered});
           }),
           py::arg("row_ptr").noconvert(), py::arg("col").noconvert(),
           py::arg("values").noconvert(), py::arg("near_nullspace").noconvert(),
           py::arg("preconditioner") = "multigrid", py::arg("ordered") = false, release_gil())
      .def(
          "refactor",
          [](linalg::BlockSolver& self, const VecRef& values, bool keep_preconditioner) {
            linalg::set_values(self.matrix().values.data(), self.matrix().values.size(), values);
            self.refactor(keep_preconditioner);
          },
          py::arg("values").noconvert(), py::arg("keep_preconditioner") = false, release_gil())
      .def(
          "solve",
          [](linalg::BlockSolver& self, const PointsRef& b, Points x, double tol, int max_iter,
             bool must_converge) {
            const Poll poll = signal_poll();
            linalg::SolveReport report =
                self.solve(b, x, linalg::solve_options(tol, max_iter, must_converge), poll);
            return std::make_pair(std::move(x), std::move(report));
          },
          py::arg("b").noconvert(), py::arg("x"), py::arg("tol") = 1e-3, py::arg("max_iter") = 500,
          py::arg("must_converge") = true, release_gil());
  m.def("translations", &linalg::translations, py::arg("n"));
  m.def("rigid_body_modes", &linalg::rigid_body_modes, py::arg("points").noconvert());
}

void bind_stretch(py::module_& m) {
  m.def("surface_stretch_energy", &area::surface_stretch_energy, py::arg("faces").noconvert(),
        py::arg("areas"), py::arg("image").noconvert(), release_gil());
  m.def(
      "surface_stretch_laplacian",
      [](const FacesRef& faces, const VecRef& areas, const PointsRef& image) {
        const area::SurfacePattern pattern(faces, static_cast<Index>(image.rows()), 1);
        return area::surface_stretch_laplacian(pattern, faces, areas, image);
      },
      py::arg("faces").noconvert(), py::arg("areas"), py::arg("image").noconvert(), release_gil());
  m.def("chart_stretch_energy", &area::chart_stretch_energy, py::arg("chart"), py::arg("areas"),
        py::arg("periods"), py::arg("turns").noconvert(), release_gil());
  m.def(
      "chart_stretch_laplacian",
      [](const area::SurfaceChart& chart, const VecRef& areas, const Eigen::Vector2d& periods,
         const Points2Ref& turns) {
        const area::SurfacePattern pattern(chart.faces, chart.n_vertices, 1);
        return area::chart_stretch_laplacian(pattern, chart, areas, periods, turns);
      },
      py::arg("chart"), py::arg("areas"), py::arg("periods"), py::arg("turns").noconvert(),
      release_gil());
  m.def("chart_stretch_product", &area::chart_stretch_product, py::arg("chart"), py::arg("areas"),
        py::arg("periods"), py::arg("frozen").noconvert(), py::arg("turns").noconvert(),
        release_gil());
}

void bind_area(py::module_& m) {
  m.def("equal_area_from_angle", &area::equal_area_from_angle, py::arg("v"), py::arg("tube_ratio"),
        release_gil());
  m.def("mean_angle_distortion", &area::mean_angle_distortion, py::arg("reference"),
        py::arg("faces").noconvert(), py::arg("image").noconvert(), release_gil());
  m.def(
      "glide_energy",
      [](const area::GlideProblem& problem, double area, double shape, double chart, double scale,
         const Points2Ref& angles, bool model, double facing, double epsilon) {
        area::GlideEnergy energy =
            area::glide_energy(problem, {area, shape, chart, facing, epsilon}, scale, angles,
                               model ? area::Derivatives::kModel : area::Derivatives::kHessian);
        const area::SurfacePattern pattern(problem.chart.faces, problem.chart.n_vertices, 2);
        SparseMatrix hessian = pattern.matrix();
        pattern.scatter(energy.hessians, hessian.valuePtr());
        return std::make_tuple(energy.value, std::move(energy.gradient), std::move(hessian));
      },
      py::arg("problem"), py::arg("area"), py::arg("shape"), py::arg("chart"), py::arg("scale"),
      py::arg("angles").noconvert(), py::arg("model") = false, py::arg("facing") = 0.0,
      py::arg("epsilon") = 0.0, release_gil());
  m.def("best_scale", &area::best_scale, py::arg("problem"), py::arg("angles").noconvert(),
        release_gil());
  m.def("glide_areas", &area::glide_areas, py::arg("problem"), py::arg("angles").noconvert(),
        release_gil());
}

void bind_volume(py::module_& m) {
  m.def(
      "tet_laplacian",
      [](const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest, const PointsRef& geometry,
         double c, const PointsRef& x, int lanes) {
        volume::TetLaplacian laplacian(tets, fixed, rest, lanes);
        SparseMatrix matrix = laplacian.pattern();
        Points rhs;
        laplacian.assemble(geometry, c, x, matrix, rhs);
        return std::make_tuple(std::move(matrix), std::move(rhs), laplacian.interior());
      },
      py::arg("tets").noconvert(), py::arg("fixed").noconvert(), py::arg("rest"),
      py::arg("geometry").noconvert(), py::arg("c"), py::arg("x").noconvert(), py::arg("lanes") = 8,
      "L_II, -L_IB x_B and the vertex of each row, for checks.");
}

}  // namespace

void bind(py::module_& m) {
  bind_mesh(m);
  bind_forms(m);
  bind_linalg(m);
  bind_stretch(m);
  bind_area(m);
  bind_volume(m);
}

}  // namespace stretchmap::testing
