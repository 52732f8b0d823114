#include "arrays.hpp"
#include "stretchmap/mesh/surface_topology.hpp"

namespace stretchmap::bindings {

void bind_mesh(py::module_& m) {
  py::class_<SurfaceTopology>(m, "SurfaceTopology")
      .def(py::init([](const FacesRef& faces, Index n) { return surface_topology(faces, n); }),
           py::arg("faces").noconvert(), py::arg("n_vertices"), release_gil())
      .def_readonly("n_vertices", &SurfaceTopology::n_vertices)
      .def_readonly("faces", &SurfaceTopology::faces)
      .def_readonly("twin", &SurfaceTopology::twin)
      .def_readonly("edge", &SurfaceTopology::edge)
      .def_readonly("edges", &SurfaceTopology::edges)
      .def_readonly("edge_halfedge", &SurfaceTopology::edge_halfedge)
      .def_readonly("vertex_halfedge", &SurfaceTopology::vertex_halfedge);
}

}  // namespace stretchmap::bindings
