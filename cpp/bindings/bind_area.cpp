#include <limits>

#include "arrays.hpp"
#include "stretchmap/area/chart.hpp"
#include "stretchmap/area/chart_newton.hpp"
#include "stretchmap/area/coarsen.hpp"
#include "stretchmap/area/edge_sags.hpp"
#include "stretchmap/area/halved_chart.hpp"
#include "stretchmap/area/phase_energies.hpp"
#include "stretchmap/area/straight_drawing.hpp"
#include "stretchmap/area/surface_newton.hpp"
#include "stretchmap/area/surface_patch.hpp"
#include "stretchmap/area/surface_reference.hpp"
#include "stretchmap/area/surface_sem.hpp"

namespace stretchmap::area {
namespace {

// Results keep the arrays they get: not those of the systems below, whose factors would live as
// long.
void bind_chart(py::module_& m) {
  py::class_<SurfaceChart>(m, "SurfaceChart")
      .def(py::init([](const mesh::SurfaceTopology& top, const IndexRows& forms) {
             return surface_chart(top, forms);
           }),
           py::arg("topology"), py::arg("forms").noconvert(), release_gil())
      .def_readonly("faces", &SurfaceChart::faces)
      .def_readonly("shift_u", &SurfaceChart::shift_u)
      .def_readonly("shift_v", &SurfaceChart::shift_v);
  py::class_<HalvedChart>(m, "HalvedChart")
      .def(py::init(&halved_chart), py::arg("chart"), py::arg("angles").noconvert(),
           py::arg("halved"), release_gil())
      .def_readonly("angles", &HalvedChart::angles)
      .def_readonly("shift_u", &HalvedChart::shift_u)
      .def_readonly("shift_v", &HalvedChart::shift_v);
  m.def("chart_forms", &chart_forms, py::arg("topology"), py::arg("shift_u").noconvert(),
        py::arg("shift_v").noconvert(), release_gil());
  m.def("turn_areas", &turn_areas, py::arg("chart"), py::arg("turns").noconvert(), release_gil());
  m.def("straight_drawing", &straight_drawing, py::arg("faces").noconvert(), py::arg("n"),
        py::arg("corners"), release_gil());
  m.def("edge_sags", &edge_sags, py::arg("topology"), py::arg("chart"),
        py::arg("areas").noconvert(), py::arg("angles").noconvert(), py::arg("ratio"),
        release_gil());
  m.def("angle_from_equal_area", &angle_from_equal_area, py::arg("s"), py::arg("tube_ratio"),
        release_gil());
}

void bind_coarse(py::module_& m) {
  py::class_<CoarseSurface>(m, "CoarseSurface")
      .def_readonly("kept", &CoarseSurface::kept)
      .def_readonly("chart", &CoarseSurface::chart);
  m.def("coarsen", &coarsen, py::arg("points").noconvert(), py::arg("chart"),
        py::arg("turns").noconvert(), py::arg("n_faces"), release_gil());
  m.def("prolong", &prolong, py::arg("coarse"), py::arg("chart"), py::arg("turns").noconvert(),
        release_gil());
}

void bind_sem(py::module_& m) {
  py::class_<SurfaceMeasures>(m, "SurfaceMeasures")
      .def_readonly("energy", &SurfaceMeasures::energy)
      .def_readonly("flips", &SurfaceMeasures::flips)
      .def_readonly("ring_std", &SurfaceMeasures::ring_std)
      .def_readonly("face_std", &SurfaceMeasures::face_std)
      .def_readonly("face_error", &SurfaceMeasures::face_error)
      .def_readonly("angle_mean", &SurfaceMeasures::angle_mean);
  py::class_<SemStep>(m, "SemStep")
      .def_readonly("step", &SemStep::step)
      .def_readonly("residual", &SemStep::residual);
  py::class_<SurfaceSem>(m, "SurfaceSem")
      .def(py::init<SurfaceChart, const VecRef&, double, Points2>(), py::arg("chart"),
           py::arg("areas"), py::arg("aspect"), py::arg("turns"), release_gil())
      .def("step", &SurfaceSem::step, release_gil())
      .def("measures", &SurfaceSem::measures, release_gil())
      .def_property_readonly("turns", &SurfaceSem::turns, py::return_value_policy::copy);
}

void bind_chart_newton(py::module_& m) {
  py::class_<NewtonStep>(m, "NewtonStep")
      .def_readonly("before", &NewtonStep::before)
      .def_readonly("after", &NewtonStep::after)
      .def_readonly("step", &NewtonStep::step)
      .def_readonly("decrement", &NewtonStep::decrement);
  py::class_<ChartStep, NewtonStep>(m, "ChartStep").def_readonly("within", &ChartStep::within);
  py::class_<ChartNewton>(m, "ChartNewton")
      .def(py::init<SurfaceChart, SurfaceReference, double, Points2>(), py::arg("chart"),
           py::arg("reference"), py::arg("aspect"), py::arg("turns"), release_gil())
      .def(
          "step",
          [](ChartNewton& self, double area, double shape, double reach) {
            return self.step({shape, area}, reach, signal_poll());
          },
          py::arg("area"), py::arg("shape"), py::arg("reach"), release_gil())
      .def("measures", &ChartNewton::measures, release_gil())
      .def_property_readonly("turns", &ChartNewton::turns, py::return_value_policy::copy);
}

void bind_quality(py::module_& m) {
  py::class_<SurfaceReference>(m, "SurfaceReference")
      .def(py::init([](const PointsRef& points, const FacesRef& faces, double max_aspect) {
             return surface_reference(points, faces, max_aspect);
           }),
           py::arg("points").noconvert(), py::arg("faces").noconvert(),
           py::arg("max_aspect") = std::numeric_limits<double>::infinity(), release_gil())
      .def_readonly("areas", &SurfaceReference::areas)
      .def_readonly("cotan", &SurfaceReference::cotan);
  m.def("phase_energies", &phase_energies, py::arg("reference"), py::arg("faces").noconvert(),
        py::arg("turns").noconvert(), py::arg("candidates").noconvert(), release_gil());
}

void bind_glide(py::module_& m) {
  py::class_<GlideProblem>(m, "GlideProblem")
      .def(py::init([](const SurfaceChart& chart, const SurfaceReference& reference, double ratio) {
             return GlideProblem{chart, reference, ratio};
           }),
           py::arg("chart"), py::arg("reference"), py::arg("ratio"), release_gil());
  py::class_<SurfaceWeights>(m, "SurfaceWeights")
      .def(py::init([](double area, double shape, double chart, double facing, double epsilon) {
             return SurfaceWeights{area, shape, chart, facing, epsilon};
           }),
           py::kw_only(), py::arg("area") = 1.0, py::arg("shape") = 0.0, py::arg("chart") = 0.0,
           py::arg("facing") = 0.0, py::arg("epsilon") = 0.0);
  py::class_<SurfaceNewton>(m, "SurfaceNewton")
      // No default for `held`: making an array of it would load NumPy with the module.
      .def(py::init<GlideProblem, Points2>(), py::arg("problem"), py::arg("angles"), release_gil())
      .def(py::init<GlideProblem, Points2, Flags>(), py::arg("problem"), py::arg("angles"),
           py::arg("held"), release_gil())
      .def(
          "step",
          [](SurfaceNewton& self, const SurfaceWeights& weights) {
            return self.step(weights, signal_poll());
          },
          py::arg("weights"), release_gil())
      .def(
          "project_rings",
          [](SurfaceNewton& self, const SurfaceWeights& weights, double face_std, double face_error,
             int least_best, int most_best) {
            return self.project_rings(weights, face_std, face_error, least_best, most_best,
                                      signal_poll());
          },
          py::arg("weights"), py::arg("face_std"), py::arg("face_error"), py::arg("least_best"),
          py::arg("most_best"), release_gil())
      .def("measures", &SurfaceNewton::measures, release_gil())
      .def("least_facing", &SurfaceNewton::facing, release_gil())
      .def("inward", &SurfaceNewton::inward, release_gil())
      .def("flops", &SurfaceNewton::flops, release_gil())
      .def_property_readonly("solves", &SurfaceNewton::solves)
      .def_property_readonly("curvature", &SurfaceNewton::curvature)
      .def_property("angles", &SurfaceNewton::angles, &SurfaceNewton::move_to,
                    py::return_value_policy::copy);
  py::class_<SurfacePatch>(m, "SurfacePatch")
      .def(py::init([](const SurfaceNewton& newton, const std::vector<Index>& faces, int rings) {
             return surface_patch(newton.problem(), faces, rings);
           }),
           py::arg("newton"), py::arg("faces"), py::arg("rings"), release_gil())
      .def_readonly("problem", &SurfacePatch::problem)
      .def_readonly("vertices", &SurfacePatch::vertices)
      .def_readonly("held", &SurfacePatch::held)
      .def_property_readonly(
          "n_faces", [](const SurfacePatch& self) { return self.problem.chart.faces.rows(); });
}

}  // namespace

void bind(py::module_& m) {
  bind_chart(m);
  bind_coarse(m);
  bind_sem(m);
  bind_quality(m);
  bind_chart_newton(m);
  bind_glide(m);
}

}  // namespace stretchmap::area
