#include "arrays.hpp"
#include "stretchmap/certificate/embedding.hpp"
#include "stretchmap/certificate/torus_graph.hpp"

namespace stretchmap::certificate {
void bind(py::module_& m) {
  const auto points = py::arg("points").noconvert();
  const auto faces = py::arg("faces").noconvert();
  m.def("not_positive_tets", &not_positive_tets, points, py::arg("tets").noconvert(),
        release_gil());
  m.def(
      "crossing_faces",
      [](const PointsRef& x, const FacesRef& f, Index limit) {
        return crossing_faces(x, f, limit, signal_poll());
      },
      points, faces, py::arg("limit"), release_gil());
  py::class_<TorusGraph>(m, "TorusGraph")
      .def_readonly("bad", &TorusGraph::bad)
      .def_readonly("winding", &TorusGraph::winding);
  m.def("torus_graph", &torus_graph, points, faces, py::arg("R"), py::arg("strict") = false,
        release_gil());
}

}  // namespace stretchmap::certificate
