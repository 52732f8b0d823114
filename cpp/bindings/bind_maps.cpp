#include "arrays.hpp"
#include "stretchmap/maps/surface_tree.hpp"
#include "stretchmap/maps/tet_locator.hpp"

namespace stretchmap::maps {
void bind(py::module_& m) {
  py::class_<TetLocator>(m, "TetLocator")
      .def(py::init([](const PointsRef& points, const TetsRef& tets, double tolerance) {
             return TetLocator(points, tets, tolerance, signal_poll());
           }),
           py::arg("points").noconvert(), py::arg("tets").noconvert(), py::arg("tolerance"),
           release_gil())
      .def(
          "locate",
          [](const TetLocator& self, const PointsRef& queries) {
            TetLocation found = self.locate(queries, signal_poll());
            return std::make_pair(std::move(found.tet), std::move(found.weights));
          },
          py::arg("queries").noconvert(), release_gil())
      .def("visits", &TetLocator::visits, py::arg("queries").noconvert(), release_gil());

  py::class_<SurfaceTree>(m, "SurfaceTree")
      .def(py::init<const PointsRef&, const FacesRef&>(), py::arg("points").noconvert(),
           py::arg("faces").noconvert(), release_gil())
      .def(
          "closest",
          [](const SurfaceTree& self, const PointsRef& queries) {
            SurfaceFeet feet = self.feet(queries, signal_poll());
            return std::make_tuple(std::move(feet.points), std::move(feet.face),
                                   std::move(feet.weights));
          },
          py::arg("queries").noconvert(), release_gil());
}

}  // namespace stretchmap::maps
