#include "arrays.hpp"
#include "stretchmap/resample/hex_newton.hpp"

namespace stretchmap::resample {
void bind(py::module_& m) {
  m.def(
      "jacobian_coefficients",
      [](const Eigen::Matrix<double, 8, 3, Eigen::RowMajor>& corners) {
        std::array<Eigen::Vector3d, 8> x;
        for (int c = 0; c < 8; ++c) x[c] = corners.row(c).transpose();
        return jacobian_coefficients(x);
      },
      py::arg("corners"), "Of one hexahedron, for checks.");
  m.def(
      "valid_hexes",
      [](const PointsRef& x, const HexesRef& h) { return valid_hexes(x, h, signal_poll()); },
      py::arg("points").noconvert(), py::arg("hexes").noconvert(), release_gil());
  m.def("scaled_jacobians", &scaled_jacobians, py::arg("points").noconvert(),
        py::arg("hexes").noconvert(), release_gil());
  m.def("corner_sides", &corner_sides, py::arg("points").noconvert(), py::arg("hexes").noconvert(),
        release_gil());
  m.def("least_edge_jacobians", &least_edge_jacobians, py::arg("points").noconvert(),
        py::arg("hexes").noconvert(), release_gil());
  m.def("hex_volumes", &hex_volumes, py::arg("points").noconvert(), py::arg("hexes").noconvert(),
        release_gil());

  py::class_<FitSamples>(m, "FitSamples")
      .def_readonly("share", &FitSamples::share)
      .def_readonly("distance", &FitSamples::distance)
      .def_readonly("first_of_surface", &FitSamples::first_of_surface);
  py::class_<BoundaryFit>(m, "BoundaryFit")
      .def(py::init<const PointsRef&, const FacesRef&, const PointsRef&, const IndexVecRef&,
                    const PointsRef&, const TetsRef&, int, double, bool>(),
           py::arg("points").noconvert(), py::arg("faces").noconvert(),
           py::arg("normals").noconvert(), py::arg("sample_faces").noconvert(),
           py::arg("sample_weights").noconvert(), py::arg("quads").noconvert(), py::arg("per_side"),
           py::arg("far"), py::arg("bilinear") = false, release_gil())
      .def("match", &BoundaryFit::match, py::arg("x").noconvert(), release_gil());

  py::class_<HexReport>(m, "HexReport")
      .def_readonly("energy", &HexReport::energy)
      .def_readonly("fit", &HexReport::fit)
      .def_readonly("min_det", &HexReport::min_det)
      .def_readonly("flips", &HexReport::flips);
  py::class_<HexNewtonReport>(m, "HexNewtonReport")
      .def_readonly("before", &HexNewtonReport::before)
      .def_readonly("after", &HexNewtonReport::after)
      .def_readonly("steps", &HexNewtonReport::steps)
      .def_readonly("cg_iterations", &HexNewtonReport::cg_iterations);
  py::class_<HexNewton>(m, "HexNewton")
      .def(py::init<const HexesRef&, Index>(), py::arg("hexes").noconvert(), py::arg("n"),
           release_gil())
      .def(
          "set_rest",
          [](HexNewton& self, const Eigen::Ref<const Rows24>& sides, const VecRef& weights,
             Flags guarded) { self.energy().set_rest(sides, weights, std::move(guarded)); },
          py::arg("sides").noconvert(), py::arg("weights").noconvert(), py::arg("guarded"),
          release_gil())
      .def(
          "set_fit",
          [](HexNewton& self, const FitSamples& samples, const VecRef& factor, double tolerance,
             double power, double inward) {
            self.energy().set_fit(samples, factor, {tolerance, power, inward});
          },
          py::arg("samples"), py::arg("factor").noconvert(), py::arg("tolerance") = 1.0,
          py::arg("power") = 1.0, py::arg("inward") = 0.0, release_gil())
      .def(
          "value",
          [](const HexNewton& self, const PointsRef& x, const volume::EnergyWeights& corner,
             double power) {
            return self.energy().value(x, {corner, power});
          },
          py::arg("x").noconvert(), py::arg("corner"), py::arg("power") = 1.0, release_gil())
      .def(
          "model",
          [](const HexNewton& self, const PointsRef& x, const volume::EnergyWeights& corner,
             double power) {
            Points gradient;
            linalg::BlockMatrix hessian = self.energy().pattern();
            self.energy().model(x, {corner, power}, gradient, hessian);
            return std::make_tuple(std::move(gradient), std::move(hessian.row_ptr),
                                   std::move(hessian.col), std::move(hessian.values));
          },
          py::arg("x").noconvert(), py::arg("corner"), py::arg("power") = 1.0, release_gil(),
          "Gradient and Hessian in blocks of 3x3, for checks.")
      .def(
          "run",
          [](HexNewton& self, Points x, const volume::EnergyWeights& corner, double power,
             int max_steps, double least_gain, double tol, const std::string& preconditioner) {
            HexNewtonOptions options;
            options.max_steps = max_steps;
            options.least_gain = least_gain;
            options.tol = tol;
            options.preconditioner = preconditioner;
            const HexNewtonReport report = self.run(x, {corner, power}, options, signal_poll());
            return std::make_pair(std::move(x), report);
          },
          py::arg("x"), py::arg("corner"), py::arg("power"), py::arg("max_steps"),
          py::arg("least_gain") = 1e-3, py::arg("tol") = 0.1,
          py::arg("preconditioner") = "multigrid", release_gil());
}

}  // namespace stretchmap::resample
