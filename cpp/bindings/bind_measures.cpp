#include "arrays.hpp"
#include "stretchmap/measures/element_measures.hpp"

namespace stretchmap::measures {
void bind(py::module_& m) {
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
  py::class_<ShareDeviations>(m, "ShareDeviations")
      .def_readonly("rings", &ShareDeviations::rings)
      .def_readonly("elements", &ShareDeviations::elements);
  m.def("share_deviations", &share_deviations, py::arg("elements").noconvert(),
        py::arg("source").noconvert(), py::arg("rings").noconvert(), py::arg("image").noconvert(),
        release_gil());
  m.def("direction_scatter", &direction_scatter, py::arg("directions").noconvert(),
        py::arg("metric"), release_gil());
}

}  // namespace stretchmap::measures
