#include "arrays.hpp"
#include "stretchmap/stretch/chart.hpp"
#include "stretchmap/stretch/surface_newton.hpp"
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
      .def_readonly("face_sd", &SurfaceFigures::face_sd)
      .def_readonly("face_error", &SurfaceFigures::face_error)
      .def_readonly("angle_mean", &SurfaceFigures::angle_mean);
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

template <int K>
Vec solve_once(const SparseMatrix& matrix, const VecRef& right) {
  BlockLdlt<K> factor(matrix);
  factor.factorise(matrix);
  return factor.solve(right);
}

SurfaceWeights weights_of(double area, double shape, double chart) { return {area, shape, chart}; }

void bind_glide(py::module_& m) {
  m.def("block_ldlt_solve_2", &solve_once<2>, py::arg("matrix"), py::arg("right"), release_gil());
  m.def("block_ldlt_solve_3", &solve_once<3>, py::arg("matrix"), py::arg("right"), release_gil());
  py::class_<GlideProblem>(m, "GlideProblem")
      .def(py::init([](const SurfaceChart& chart, const SurfaceReference& reference, double ratio,
                       bool facing) {
             return GlideProblem{chart, reference, ratio, facing};
           }),
           py::arg("chart"), py::arg("reference"), py::arg("ratio"), py::arg("facing") = false,
           release_gil());
  m.def(
      "glide_energy",
      [](const GlideProblem& problem, double area, double shape, double chart, double scale,
         const Points2Ref& angles, bool model) {
        GlideEnergy energy = glide_energy(problem, weights_of(area, shape, chart), scale, angles,
                                          model ? Derivatives::kModel : Derivatives::kHessian);
        const SurfacePattern pattern(problem.chart.faces, problem.chart.n_vertices, 2);
        SparseMatrix hessian = pattern.zeros();
        pattern.scatter(energy.hessians, hessian.valuePtr());
        return std::make_tuple(energy.value, std::move(energy.gradient), std::move(hessian));
      },
      py::arg("problem"), py::arg("area"), py::arg("shape"), py::arg("chart"), py::arg("scale"),
      py::arg("angles").noconvert(), py::arg("model") = false, release_gil());
  m.def("best_scale", &best_scale, py::arg("problem"), py::arg("angles").noconvert(),
        release_gil());
  m.def("glide_areas", &glide_areas, py::arg("problem"), py::arg("angles").noconvert(),
        release_gil());
  py::class_<GlideStep>(m, "GlideStep")
      .def_readonly("before", &GlideStep::before)
      .def_readonly("after", &GlideStep::after)
      .def_readonly("step", &GlideStep::step)
      .def_readonly("decrement", &GlideStep::decrement);
  py::class_<SurfaceNewton>(m, "SurfaceNewton")
      .def(py::init<GlideProblem, Points2>(), py::arg("problem"), py::arg("angles"), release_gil())
      .def(
          "step",
          [](SurfaceNewton& self, double area, double shape, double chart) {
            return self.step(weights_of(area, shape, chart), signal_poll());
          },
          py::arg("area"), py::arg("shape"), py::arg("chart"), release_gil())
      .def(
          "project_rings",
          [](SurfaceNewton& self, double area, double shape, double chart, double face_sd,
             double face_error) {
            return self.project_rings(weights_of(area, shape, chart), face_sd, face_error,
                                      signal_poll());
          },
          py::arg("area"), py::arg("shape"), py::arg("chart"), py::arg("face_sd"),
          py::arg("face_error"), release_gil())
      .def("figures", &SurfaceNewton::figures, release_gil())
      .def_property_readonly("angles", &SurfaceNewton::angles);
}

}  // namespace

void bind_area(py::module_& m) {
  bind_chart(m);
  bind_stretch(m);
  bind_sem(m);
  bind_quality(m);
  bind_glide(m);
}

}  // namespace stretchmap::bindings
