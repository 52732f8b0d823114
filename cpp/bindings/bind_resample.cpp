#include "arrays.hpp"
#include "stretchmap/resample/grid_relax.hpp"

namespace stretchmap::resample {
void bind(py::module_& m) {
  m.def(
      "relax_grid",
      [](const TetsRef& corners, const RowsRef& rest, const VecRef& weights,
         const volume::EnergyWeights& corner, double slack, double power, const PointsRef& home,
         const Points2Ref& home_y, const VecRef& pull, const registration::ChartLocator& locator,
         const PointsRef& points, const FacesRef& faces, const RowsRef& slopes,
         const IndexVecRef& rim, int sweeps, Points2 y, Points x, Vec reach) {
        const registration::RelaxReport report =
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
}

}  // namespace stretchmap::resample
