#include "arrays.hpp"
#include "stretchmap/apply/chart_locator.hpp"
#include "stretchmap/apply/grid_relax.hpp"
#include "stretchmap/apply/split_tets.hpp"
#include "stretchmap/apply/surface_match.hpp"
#include "stretchmap/apply/surface_relax.hpp"
#include "stretchmap/apply/tet_locator.hpp"

namespace stretchmap::bindings {

void bind_apply(py::module_& m) {
  py::class_<TetLocator>(m, "TetLocator")
      .def(py::init<const PointsRef&, const TetsRef&, double>(), py::arg("points").noconvert(),
           py::arg("tets").noconvert(), py::arg("tolerance"), release_gil())
      .def(
          "locate",
          [](const TetLocator& self, const PointsRef& queries) {
            TetLocation found = self.locate(queries, signal_poll());
            return std::make_pair(std::move(found.tet), std::move(found.weights));
          },
          py::arg("queries").noconvert(), release_gil());

  py::class_<ChartLocator>(m, "ChartLocator")
      .def(py::init<SurfaceChart, const Points2Ref&>(), py::arg("chart"),
           py::arg("turns").noconvert(), release_gil())
      .def(
          "locate",
          [](const ChartLocator& self, const Points2Ref& queries) {
            FaceLocation found = self.locate(queries);
            return std::make_pair(std::move(found.face), std::move(found.weights));
          },
          py::arg("queries").noconvert(), release_gil());

  m.def("match_value", &match_value, py::arg("chart"), py::arg("y").noconvert(),
        py::arg("X").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
        release_gil());
  m.def(
      "match_model",
      [](const SurfaceChart& chart, const Points2Ref& y, const PointsRef& X, const RowsRef& slopes,
         const RowsRef& rest, const VecRef& weights) {
        MatchModel model = match_model(chart, y, X, slopes, rest, weights);
        return std::make_pair(std::move(model.gradient), std::move(model.hessian));
      },
      py::arg("chart"), py::arg("y").noconvert(), py::arg("X").noconvert(),
      py::arg("slopes").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
      release_gil());

  m.def("flat_value", &flat_value, py::arg("chart"), py::arg("y").noconvert(), py::arg("lattice"),
        py::arg("rest").noconvert(), py::arg("weights").noconvert(), release_gil());
  m.def(
      "flat_model",
      [](const SurfaceChart& chart, const Points2Ref& y, const Eigen::Matrix2d& lattice,
         const RowsRef& rest, const VecRef& weights) {
        MatchModel model = flat_model(chart, y, lattice, rest, weights);
        return std::make_pair(std::move(model.gradient), std::move(model.hessian));
      },
      py::arg("chart"), py::arg("y").noconvert(), py::arg("lattice"), py::arg("rest").noconvert(),
      py::arg("weights").noconvert(), release_gil());
  m.def(
      "relax_match",
      [](const SurfaceChart& chart, const ChartLocator& locator, const PointsRef& target_points,
         const FacesRef& target_faces, const RowsRef& target_slopes, const RowsRef& rest,
         const VecRef& weights, const FlagsRef& held, int sweeps, Points2 y, Points X, Vec reach) {
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

  m.def(
      "relax_grid",
      [](const TetsRef& corners, const RowsRef& rest, const VecRef& weights,
         const EnergyWeights& corner, double slack, double power, const PointsRef& home,
         const Points2Ref& home_y, const VecRef& pull, const ChartLocator& locator,
         const PointsRef& points, const FacesRef& faces, const RowsRef& slopes,
         const IndexVecRef& rim, int sweeps, Points2 y, Points x, Vec reach) {
        const RelaxReport report =
            relax_grid({corners, rest, weights}, {corner, slack, power, home, home_y, pull},
                       {locator, points, faces, slopes}, rim, sweeps, y, x, reach, signal_poll());
        return std::make_tuple(std::move(y), std::move(x), std::move(reach), report.gain,
                               report.moved);
      },
      py::arg("corners").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
      py::arg("corner_energy"), py::arg("slack"), py::arg("power"), py::arg("home").noconvert(),
      py::arg("home_y").noconvert(), py::arg("pull").noconvert(), py::arg("locator"),
      py::arg("points").noconvert(), py::arg("faces").noconvert(), py::arg("slopes").noconvert(),
      py::arg("rim").noconvert(), py::arg("sweeps"), py::arg("y"), py::arg("x"), py::arg("reach"),
      release_gil());

  py::class_<TetSplit>(m, "TetSplit")
      .def_readonly("tets", &TetSplit::tets)
      .def_readonly("side", &TetSplit::side)
      .def_readonly("parent", &TetSplit::parent)
      .def_readonly("cut_edges", &TetSplit::cut_edges)
      .def_readonly("cut_weight", &TetSplit::cut_weight);
  m.def("split_tets", &split_tets, py::arg("tets").noconvert(), py::arg("values").noconvert(),
        py::arg("gate").noconvert(), release_gil());
  m.def("volume_below", &volume_below, py::arg("tets").noconvert(), py::arg("volumes").noconvert(),
        py::arg("values").noconvert(), release_gil());
}

}  // namespace stretchmap::bindings
