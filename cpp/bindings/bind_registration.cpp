#include "arrays.hpp"
#include "stretchmap/registration/chart_locator.hpp"
#include "stretchmap/registration/surface_match.hpp"
#include "stretchmap/registration/surface_relax.hpp"

namespace stretchmap::registration {
namespace {

void bind_locator(py::module_& m) {
  py::class_<ChartLocator>(m, "ChartLocator")
      .def(py::init<area::SurfaceChart, const Points2Ref&>(), py::arg("chart"),
           py::arg("turns").noconvert(), release_gil())
      .def(
          "locate",
          [](const ChartLocator& self, const Points2Ref& queries) {
            FaceLocation found = self.locate(queries);
            return std::make_pair(std::move(found.face), std::move(found.weights));
          },
          py::arg("queries").noconvert(), release_gil());
}

void bind_match(py::module_& m) {
  m.def("match_value", &match_value, py::arg("chart"), py::arg("y").noconvert(),
        py::arg("X").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
        release_gil());
  m.def(
      "match_model",
      [](const area::SurfaceChart& chart, const Points2Ref& y, const PointsRef& X,
         const RowsRef& slopes, const RowsRef& rest, const VecRef& weights) {
        MatchModel model = match_model(chart, y, X, slopes, rest, weights);
        return std::make_pair(std::move(model.gradient), std::move(model.hessian));
      },
      py::arg("chart"), py::arg("y").noconvert(), py::arg("X").noconvert(),
      py::arg("slopes").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
      release_gil());
  m.def("cover_value", &cover_value, py::arg("chart"), py::arg("y").noconvert(), py::arg("home"),
        py::arg("metric").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
        release_gil());
  m.def(
      "cover_model",
      [](const area::SurfaceChart& chart, const Points2Ref& y, const IndexVecRef& home,
         const RowsRef& metric, const RowsRef& rest, const VecRef& weights) {
        MatchModel model = cover_model(chart, y, home, metric, rest, weights);
        return std::make_pair(std::move(model.gradient), std::move(model.hessian));
      },
      py::arg("chart"), py::arg("y").noconvert(), py::arg("home"), py::arg("metric").noconvert(),
      py::arg("rest").noconvert(), py::arg("weights").noconvert(), release_gil());
  m.def("flat_value", &flat_value, py::arg("chart"), py::arg("y").noconvert(), py::arg("lattice"),
        py::arg("rest").noconvert(), py::arg("weights").noconvert(), release_gil());
  m.def(
      "flat_model",
      [](const area::SurfaceChart& chart, const Points2Ref& y, const Eigen::Matrix2d& lattice,
         const RowsRef& rest, const VecRef& weights) {
        MatchModel model = flat_model(chart, y, lattice, rest, weights);
        return std::make_pair(std::move(model.gradient), std::move(model.hessian));
      },
      py::arg("chart"), py::arg("y").noconvert(), py::arg("lattice"), py::arg("rest").noconvert(),
      py::arg("weights").noconvert(), release_gil());
  m.def(
      "relax_match",
      [](const area::SurfaceChart& chart, const ChartLocator& locator,
         const PointsRef& target_points, const FacesRef& target_faces, const RowsRef& target_slopes,
         const RowsRef& rest, const VecRef& weights, const FlagsRef& held, int sweeps, Points2 y,
         Points X, Vec reach) {
        const SurfaceWalk target{locator, target_points, target_faces, target_slopes};
        const RelaxReport report =
            relax_match(chart, target, rest, weights, held, sweeps, y, X, reach, signal_poll());
        return std::make_tuple(std::move(y), std::move(X), std::move(reach), report.gain,
                               report.moved);
      },
      py::arg("chart"), py::arg("locator"), py::arg("target_points").noconvert(),
      py::arg("target_faces").noconvert(), py::arg("target_slopes").noconvert(),
      py::arg("rest").noconvert(), py::arg("weights").noconvert(), py::arg("held").noconvert(),
      py::arg("sweeps"), py::arg("y"), py::arg("X"), py::arg("reach"), release_gil());
}

}  // namespace

void bind(py::module_& m) {
  bind_locator(m);
  bind_match(m);
}

}  // namespace stretchmap::registration
