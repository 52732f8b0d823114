#include "arrays.hpp"
#include "stretchmap/mesh/diagnosis.hpp"
#include "stretchmap/mesh/fill_borders.hpp"
#include "stretchmap/mesh/halved_faces.hpp"
#include "stretchmap/mesh/longest_first.hpp"
#include "stretchmap/mesh/orient.hpp"
#include "stretchmap/mesh/overconstrained.hpp"
#include "stretchmap/mesh/size.hpp"
#include "stretchmap/mesh/surface_topology.hpp"
#include "stretchmap/mesh/tet_boundary.hpp"

namespace stretchmap::mesh {
namespace {

void bind_topology(py::module_& m) {
  py::class_<SurfaceTopology>(m, "SurfaceTopology")
      .def(py::init([](const FacesRef& faces, Index n) { return surface_topology(faces, n); }),
           py::arg("faces").noconvert(), py::arg("n_vertices"), release_gil())
      .def_readonly("n_vertices", &SurfaceTopology::n_vertices)
      .def_readonly("faces", &SurfaceTopology::faces)
      .def_readonly("twin", &SurfaceTopology::twin)
      .def_readonly("edge", &SurfaceTopology::edge)
      .def_readonly("edges", &SurfaceTopology::edges);
  py::class_<HalvedFaces>(m, "HalvedFaces")
      .def(py::init(&halve_edges), py::arg("topology"), py::arg("marked").noconvert(),
           py::arg("lengths").noconvert(), release_gil())
      .def_readonly("ends", &HalvedFaces::ends)
      .def_readonly("faces", &HalvedFaces::faces)
      .def_readonly("parent", &HalvedFaces::parent);
  py::class_<TetBoundary>(m, "TetBoundary")
      .def(py::init(
               [](const TetsRef& tets, Index n) { return tet_boundary(tets, n, signal_poll()); }),
           py::arg("tets").noconvert(), py::arg("n_vertices"), release_gil())
      .def_readonly("faces", &TetBoundary::faces)
      .def_readonly("vertices", &TetBoundary::vertices)
      .def_readonly("index", &TetBoundary::index)
      .def_readonly("tets", &TetBoundary::tets);
  m.def(
      "tet_edges", [](const TetsRef& tets, Index n) { return tet_edges(tets, n, signal_poll()); },
      py::arg("tets").noconvert(), py::arg("n_vertices"), release_gil());
}

void bind_sizes(py::module_& m) {
  const auto points = py::arg("points").noconvert();
  const auto faces = py::arg("faces").noconvert();
  const auto tets = py::arg("tets").noconvert();
  m.def("face_area_vectors", &face_area_vectors, points, faces, release_gil());
  m.def("face_areas", &face_areas, points, faces, release_gil());
  m.def("edge_lengths", &edge_lengths, py::arg("topology"), py::arg("points").noconvert(),
        release_gil());
  m.def("tet_volumes", &tet_volumes, points, tets, release_gil());
  m.def("enclosed_volume", &enclosed_volume, points, faces, release_gil());
  m.def("misoriented_faces", &misoriented_faces, points, faces, release_gil());
  m.def("misoriented_tets", &misoriented_tets, points, tets, release_gil());
}

void bind_diagnosis(py::module_& m) {
  py::class_<SurfaceDiagnosis>(m, "SurfaceDiagnosis")
      .def(py::init(&diagnose_surface), py::arg("points").noconvert(), py::arg("faces").noconvert(),
           release_gil())
      .def_readonly("repeated", &SurfaceDiagnosis::repeated)
      .def_readonly("duplicates", &SurfaceDiagnosis::duplicates)
      .def_readonly("degenerate", &SurfaceDiagnosis::degenerate)
      .def_readonly("misoriented", &SurfaceDiagnosis::misoriented)
      .def_readonly("conflicts", &SurfaceDiagnosis::conflicts)
      .def_readonly("inside_out", &SurfaceDiagnosis::inside_out)
      .def_readonly("nonmanifold_edges", &SurfaceDiagnosis::nonmanifold_edges)
      .def_readonly("border_edges", &SurfaceDiagnosis::border_edges)
      .def_readonly("nonmanifold_vertices", &SurfaceDiagnosis::nonmanifold_vertices)
      .def_readonly("unreferenced", &SurfaceDiagnosis::unreferenced)
      .def_readonly("component", &SurfaceDiagnosis::component)
      .def_readonly("euler", &SurfaceDiagnosis::euler)
      .def_readonly("genus", &SurfaceDiagnosis::genus);
  py::class_<SolidDiagnosis>(m, "SolidDiagnosis")
      .def(py::init([](const PointsRef& points, const TetsRef& tets) {
             return diagnose_solid(points, tets, signal_poll());
           }),
           py::arg("points").noconvert(), py::arg("tets").noconvert(), release_gil())
      .def_readonly("repeated", &SolidDiagnosis::repeated)
      .def_readonly("duplicates", &SolidDiagnosis::duplicates)
      .def_readonly("degenerate", &SolidDiagnosis::degenerate)
      .def_readonly("misoriented", &SolidDiagnosis::misoriented)
      .def_readonly("inverted", &SolidDiagnosis::inverted)
      .def_readonly("conflicts", &SolidDiagnosis::conflicts)
      .def_readonly("nonmanifold_faces", &SolidDiagnosis::nonmanifold_faces)
      .def_readonly("nonmanifold_edges", &SolidDiagnosis::nonmanifold_edges)
      .def_readonly("nonmanifold_vertices", &SolidDiagnosis::nonmanifold_vertices)
      .def_readonly("unreferenced", &SolidDiagnosis::unreferenced)
      .def_readonly("component", &SolidDiagnosis::component)
      .def_readonly("euler", &SolidDiagnosis::euler)
      .def_readonly("boundary_faces", &SolidDiagnosis::boundary_faces)
      .def_readonly("boundary_component", &SolidDiagnosis::boundary_component)
      .def_readonly("boundary_genus", &SolidDiagnosis::boundary_genus);
}

void bind_overconstrained(py::module_& m) {
  py::class_<OverconstrainedElements>(m, "OverconstrainedElements")
      .def(py::init([](const TetsRef& tets, Index n) {
             return overconstrained_elements(tets, n, signal_poll());
           }),
           py::arg("tets").noconvert(), py::arg("n_vertices"), release_gil())
      .def_readonly("edges", &OverconstrainedElements::edges)
      .def_readonly("faces", &OverconstrainedElements::faces)
      .def_readonly("tets", &OverconstrainedElements::tets);
  py::class_<Refinement>(m, "Refinement")
      .def(py::init([](const PointsRef& points, const TetsRef& tets, const PointsRef& seen) {
             return refine_overconstrained(points, tets, seen, signal_poll());
           }),
           py::arg("points").noconvert(), py::arg("tets").noconvert(), py::arg("seen").noconvert(),
           release_gil())
      .def_readonly("points", &Refinement::points)
      .def_readonly("tets", &Refinement::tets)
      .def_readonly("parent_tet", &Refinement::parent_tet)
      .def_readonly("split", &Refinement::split);
  m.def("longest_first", &longest_first, py::arg("points").noconvert(),
        py::arg("edges").noconvert(), release_gil());
}

void bind_fill_borders(py::module_& m) {
  py::class_<BorderFill>(m, "BorderFill")
      .def(py::init([](const PointsRef& points, const SurfaceTopology& top) {
             return fill_borders(points, top, signal_poll());
           }),
           py::arg("points").noconvert(), py::arg("topology"), release_gil())
      .def_readonly("loops", &BorderFill::loops)
      .def_readonly("faces", &BorderFill::faces)
      .def_readonly("hole", &BorderFill::hole)
      .def_readonly("centers", &BorderFill::centers);
}

}  // namespace

void bind(py::module_& m) {
  bind_topology(m);
  bind_sizes(m);
  bind_diagnosis(m);
  bind_overconstrained(m);
  bind_fill_borders(m);
}

}  // namespace stretchmap::mesh
