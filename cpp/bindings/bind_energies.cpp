#include "arrays.hpp"
#include "stretchmap/energies/element_derivatives.hpp"
#include "stretchmap/volume/line_bound.hpp"

namespace stretchmap::energies {

void bind(py::module_& m) {
  py::class_<ElementDerivatives>(m, "ElementDerivatives")
      .def_readonly("values", &ElementDerivatives::values)
      .def_readonly("gradients", &ElementDerivatives::gradients)
      .def_readonly("hessians", &ElementDerivatives::hessians);
  m.def(
      "tet_stretch",
      [](const PointsRef& image, const TetsRef& tets, const VecRef& rest, int order) {
        return tet_stretch(image, tets, rest, static_cast<Order>(order));
      },
      py::arg("image").noconvert(), py::arg("tets").noconvert(),
      py::arg("rest_volumes").noconvert(), py::arg("order"), release_gil());
  m.def(
      "face_stretch",
      [](const PointsRef& image, const FacesRef& faces, const VecRef& rest, int order) {
        return face_stretch(image, faces, rest, static_cast<Order>(order));
      },
      py::arg("image").noconvert(), py::arg("faces").noconvert(), py::arg("rest_areas").noconvert(),
      py::arg("order"), release_gil());
  m.def(
      "tet_distortion",
      [](const PointsRef& image, const TetsRef& tets, const RowsRef& rest, const VecRef& weights,
         const volume::EnergyWeights& w, int order, bool projected) {
        return tet_distortion(image, tets, rest, weights, w, static_cast<Order>(order), projected);
      },
      py::arg("image").noconvert(), py::arg("tets").noconvert(), py::arg("rest").noconvert(),
      py::arg("weights").noconvert(), py::arg("energy"), py::arg("order"), py::arg("projected"),
      release_gil());
  m.def("longest_steps", &volume::longest_steps, py::arg("tets").noconvert(),
        py::arg("image").noconvert(), py::arg("direction").noconvert(), py::arg("limit"),
        release_gil());
}

}  // namespace stretchmap::energies
