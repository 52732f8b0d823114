#include "arrays.hpp"
#include "stretchmap/distortion/element_measures.hpp"
#include "stretchmap/distortion/level_histogram.hpp"

namespace stretchmap::bindings {

void bind_distortion(py::module_& m) {
  py::class_<ElementMeasures>(m, "ElementMeasures")
      .def_readonly("source", &ElementMeasures::source)
      .def_readonly("image", &ElementMeasures::image)
      .def_readonly("angle", &ElementMeasures::angle)
      .def_readonly("conformal", &ElementMeasures::conformal);

  m.def("face_measures", &face_measures, py::arg("points").noconvert(),
        py::arg("faces").noconvert(), py::arg("image").noconvert(), py::arg("sign").noconvert(),
        release_gil());
  m.def("tet_measures", &tet_measures, py::arg("points").noconvert(), py::arg("tets").noconvert(),
        py::arg("image").noconvert(), release_gil());
  m.def("ring_sums", &ring_sums, py::arg("elements").noconvert(), py::arg("values").noconvert(),
        py::arg("n_vertices"), release_gil());
  m.def("level_histogram", &level_histogram, py::arg("tets").noconvert(),
        py::arg("values").noconvert(), py::arg("amounts").noconvert(), py::arg("bins"),
        py::arg("period"), py::arg("periodic"), release_gil());
  m.def("level_lookup", &level_lookup, py::arg("tets").noconvert(), py::arg("values").noconvert(),
        py::arg("table").noconvert(), py::arg("period"), py::arg("periodic"), release_gil());
}

}  // namespace stretchmap::bindings
