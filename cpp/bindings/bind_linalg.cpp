#include "arrays.hpp"
#include "solves.hpp"
#include "stretchmap/linalg/spd_solver.hpp"
#include "stretchmap/linalg/symmetric.hpp"

namespace stretchmap::linalg {
void bind(py::module_& m) {
  py::class_<SolveReport>(m, "SolveReport")
      .def_readonly("iterations", &SolveReport::iterations)
      .def_readonly("residual", &SolveReport::residual)
      .def_readonly("converged", &SolveReport::converged)
      .def_readonly("negative_curvature", &SolveReport::negative_curvature);
  py::class_<SpdSolver>(m, "SpdSolver")
      .def(py::init([](const SparseMatrix& A, const std::string& backend) {
             return SpdSolver(SparseMatrix(A), SpdOptions{backend});
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
  m.def(
      "normal_matrix",
      [](const RowsRef& A, const VecRef& weights) {
        if (A.rows() != weights.size()) throw Error("SolverError", "a weight for every row");
        return normal_matrix(A, weights);
      },
      py::arg("A").noconvert(), py::arg("weights").noconvert(), release_gil());
  m.def("solve_dense", &solve_dense, py::arg("A").noconvert(), py::arg("b").noconvert(),
        release_gil());
}

}  // namespace stretchmap::linalg
