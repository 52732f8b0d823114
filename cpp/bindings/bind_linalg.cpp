#include "arrays.hpp"
#include "stretchmap/linalg/block_solver.hpp"
#include "stretchmap/linalg/spd_solver.hpp"

namespace stretchmap::bindings {
namespace {

SolveOptions solve_options(double tol, int max_iter, bool must_converge) {
  return {tol, max_iter, must_converge};
}

void set_values(double* target, Eigen::Index size, const VecRef& values) {
  if (values.size() != size) throw Error("SolverError", "the pattern has another number of values");
  Eigen::Map<Vec>(target, size) = values;
}

void bind_spd(py::module_& m) {
  py::class_<SpdSolver>(m, "SpdSolver")
      .def(py::init([](const SparseMatrix& A, const std::string& backend) {
             return SpdSolver(A, SpdOptions{backend});
           }),
           py::arg("matrix"), py::arg("backend") = "auto", release_gil())
      .def(
          "refactor",
          [](SpdSolver& self, const VecRef& values, bool keep_preconditioner) {
            set_values(self.matrix().valuePtr(), self.matrix().nonZeros(), values);
            self.refactor(keep_preconditioner);
          },
          py::arg("values").noconvert(), py::arg("keep_preconditioner") = false, release_gil())
      .def(
          "solve",
          [](SpdSolver& self, const RowsRef& B, Rows X, double tol, int max_iter,
             bool must_converge) {
            const Poll poll = signal_poll();
            SolveReport report =
                self.solve(B, X, solve_options(tol, max_iter, must_converge), poll);
            return std::make_pair(std::move(X), std::move(report));
          },
          py::arg("B").noconvert(), py::arg("X"), py::arg("tol") = 1e-10, py::arg("max_iter") = 500,
          py::arg("must_converge") = true, release_gil())
      .def_property_readonly("backend", &SpdSolver::backend);
}

void bind_block(py::module_& m) {
  py::class_<BlockSolver>(m, "BlockSolver")
      .def(py::init([](const IndexVecRef& row_ptr, const IndexVecRef& col, const VecRef& values,
                       const RowsRef& near_nullspace, const std::string& preconditioner) {
             return BlockSolver(BlockMatrix{row_ptr, col, values}, near_nullspace,
                                BlockOptions{preconditioner});
           }),
           py::arg("row_ptr").noconvert(), py::arg("col").noconvert(),
           py::arg("values").noconvert(), py::arg("near_nullspace").noconvert(),
           py::arg("preconditioner") = "multigrid", release_gil())
      .def(
          "refactor",
          [](BlockSolver& self, const VecRef& values, bool keep_preconditioner) {
            set_values(self.matrix().values.data(), self.matrix().values.size(), values);
            self.refactor(keep_preconditioner);
          },
          py::arg("values").noconvert(), py::arg("keep_preconditioner") = false, release_gil())
      .def(
          "solve",
          [](BlockSolver& self, const PointsRef& b, Points x, double tol, int max_iter,
             bool must_converge) {
            const Poll poll = signal_poll();
            SolveReport report =
                self.solve(b, x, solve_options(tol, max_iter, must_converge), poll);
            return std::make_pair(std::move(x), std::move(report));
          },
          py::arg("b").noconvert(), py::arg("x"), py::arg("tol") = 1e-3, py::arg("max_iter") = 500,
          py::arg("must_converge") = true, release_gil());
  m.def("translations", &translations, py::arg("n"));
  m.def("rigid_body_modes", &rigid_body_modes, py::arg("points").noconvert());
}

}  // namespace

void bind_linalg(py::module_& m) {
  py::class_<SolveReport>(m, "SolveReport")
      .def_readonly("iterations", &SolveReport::iterations)
      .def_readonly("residual", &SolveReport::residual)
      .def_readonly("converged", &SolveReport::converged)
      .def_readonly("negative_curvature", &SolveReport::negative_curvature);
  bind_spd(m);
  bind_block(m);
}

}  // namespace stretchmap::bindings
