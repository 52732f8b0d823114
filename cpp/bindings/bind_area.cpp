#include "arrays.hpp"
#include "stretchmap/stretch/chart.hpp"
#include "stretchmap/stretch/surface_quality.hpp"
#include "stretchmap/stretch/surface_sem.hpp"
#include "stretchmap/stretch/surface_stretch.hpp"

namespace stretchmap::bindings {
namespace {

void bind_chart(py::module_& m) {
  py::class_<SurfaceChart>(m, "SurfaceChart")
      .def(py::init([](const SurfaceTopology& top, const IndexRows& forms) {
             return surface_chart(top, forms);
           }),
           py::arg("topology"), py::arg("forms").noconvert(), release_gil())
      .def_readonly("faces", &SurfaceChart::faces)
      .def_readonly("shift_u", &SurfaceChart::shift_u)
      .def_readonly("shift_v", &SurfaceChart::shift_v);
  m.def("turn_areas", &turn_areas, py::arg("chart"), py::arg("turns").noconvert(), release_gil());
  m.def("equal_area_from_angle", &equal_area_from_angle, py::arg("v"), py::arg("tube_ratio"),
        release_gil());
  m.def("angle_from_equal_area", &angle_from_equal_area, py::arg("s"), py::arg("tube_ratio"),
        release_gil());
}

void bind_stretch(py::module_& m) {
  m.def("surface_stretch_energy", &surface_stretch_energy, py::arg("faces").noconvert(),
        py::arg("areas"), py::arg("image").noconvert(), release_gil());
  m.def(
      "surface_stretch_laplacian",
      [](const FacesRef& faces, const VecRef& areas, const PointsRef& image) {
        const SurfacePattern pattern(faces, static_cast<Index>(image.rows()), 1);
        return surface_stretch_laplacian(pattern, faces, areas, image);
      },
      py::arg("faces").noconvert(), py::arg("areas"), py::arg("image").noconvert(), release_gil());
  m.def("chart_stretch_energy", &chart_stretch_energy, py::arg("chart"), py::arg("areas"),
        py::arg("periods"), py::arg("turns").noconvert(), release_gil());
  m.def(
      "chart_stretch_laplacian",
      [](const SurfaceChart& chart, const VecRef& areas, const Eigen::Vector2d& periods,
         const Points2Ref& turns) {
        const SurfacePattern pattern(chart.faces, chart.n_vertices, 1);
        return chart_stretch_laplacian(pattern, chart, areas, periods, turns);
      },
      py::arg("chart"), py::arg("areas"), py::arg("periods"), py::arg("turns").noconvert(),
      release_gil());
  m.def("chart_stretch_product", &chart_stretch_product, py::arg("chart"), py::arg("areas"),
        py::arg("periods"), py::arg("frozen").noconvert(), py::arg("turns").noconvert(),
        release_gil());
}

void bind_sem(py::module_& m) {
  py::class_<SurfaceFigures>(m, "SurfaceFigures")
      .def_readonly("energy", &SurfaceFigures::energy)
      .def_readonly("flips", &SurfaceFigures::flips)
      .def_readonly("ring_sd", &SurfaceFigures::ring_sd)
      .def_readonly("face_sd", &SurfaceFigures::face_sd);
  py::class_<SemStep>(m, "SemStep")
      .def_readonly("step", &SemStep::step)
      .def_readonly("residual", &SemStep::residual);
  py::class_<SurfaceSem>(m, "SurfaceSem")
      .def(py::init<SurfaceChart, const VecRef&, double, Points2>(), py::arg("chart"),
           py::arg("areas"), py::arg("aspect"), py::arg("turns"), release_gil())
      .def("step", &SurfaceSem::step, release_gil())
      .def("figures", &SurfaceSem::figures, release_gil())
      .def_property_readonly("turns", &SurfaceSem::turns);
}

void bind_quality(py::module_& m) {
  py::class_<SurfaceReference>(m, "SurfaceReference")
      .def(py::init([](const PointsRef& points, const FacesRef& faces) {
             return surface_reference(points, faces);
           }),
           py::arg("points").noconvert(), py::arg("faces").noconvert(), release_gil())
      .def_readonly("areas", &SurfaceReference::areas)
      .def_readonly("cotan", &SurfaceReference::cotan);
  py::class_<SurfaceQuality>(m, "SurfaceQuality")
      .def_readonly("energy", &SurfaceQuality::energy)
      .def_readonly("face_sd", &SurfaceQuality::face_sd)
      .def_readonly("angle_mean", &SurfaceQuality::angle_mean)
      .def_readonly("angle_max", &SurfaceQuality::angle_max);
  m.def("surface_quality", &surface_quality, py::arg("reference"), py::arg("faces").noconvert(),
        py::arg("image").noconvert(), release_gil());
  m.def("torus_image", &torus_image, py::arg("turns").noconvert(), py::arg("phase"),
        py::arg("ratio"), release_gil());
  m.def("phase_qualities", &phase_qualities, py::arg("reference"), py::arg("faces").noconvert(),
        py::arg("turns").noconvert(), py::arg("candidates").noconvert(), release_gil());
}

}  // namespace

void bind_area(py::module_& m) {
  bind_chart(m);
  bind_stretch(m);
  bind_sem(m);
  bind_quality(m);
}

}  // namespace stretchmap::bindings
