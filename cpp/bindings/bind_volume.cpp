#include <limits>
#include <optional>

#include "arrays.hpp"
#include "stretchmap/volume/level_histogram.hpp"
#include "stretchmap/volume/mesh_surface.hpp"
#include "stretchmap/volume/rest_shape.hpp"
#include "stretchmap/volume/ring_projection.hpp"
#include "stretchmap/volume/solid_newton.hpp"
#include "stretchmap/volume/volumetric_stretch.hpp"

namespace stretchmap::volume {
namespace {

linalg::SolveOptions solve_options(double tol, int max_iter) {
  linalg::SolveOptions options;
  options.tol = tol;
  options.max_iter = max_iter;
  return options;
}

void bind_stretch(py::module_& m) {
  py::class_<VolumetricStretch>(m, "VolumetricStretch")
      .def(py::init<const TetsRef&, const FlagsRef&, const VecRef&, std::string>(),
           py::arg("tets").noconvert(), py::arg("fixed").noconvert(),
           py::arg("rest_volumes").noconvert(), py::arg("backend") = "auto", release_gil())
      .def_property_readonly("backend", &VolumetricStretch::backend)
      .def(
          "harmonic",
          [](VolumetricStretch& self, const PointsRef& source, Points x, double tol, int max_iter) {
            const auto report =
                self.harmonic(source, x, solve_options(tol, max_iter), signal_poll());
            return std::make_pair(std::move(x), report);
          },
          py::arg("source").noconvert(), py::arg("x"), py::arg("tol") = 1e-10,
          py::arg("max_iter") = 1000, release_gil())
      .def(
          "step",
          [](VolumetricStretch& self, Points x, double c, double tol, int max_iter, bool follow) {
            const auto report =
                self.step(x, c, follow, solve_options(tol, max_iter), signal_poll());
            return std::make_pair(std::move(x), report);
          },
          py::arg("x"), py::arg("c"), py::arg("tol") = 1e-10, py::arg("max_iter") = 1000,
          py::arg("follow") = false, release_gil());
  m.def("tet_stretch_energy", &tet_stretch_energy, py::arg("image_volumes"),
        py::arg("rest_volumes"), release_gil());
}

void bind_newton(py::module_& m) {
  py::class_<EnergyWeights>(m, "EnergyWeights")
      .def(py::init([](double shape, double volume, double epsilon, double face, double soft) {
             return EnergyWeights{shape, volume, epsilon, face, 0.0, soft};
           }),
           py::arg("shape"), py::arg("volume"), py::arg("epsilon") = 0.0, py::arg("face") = 0.0,
           py::arg("soft") = 0.0)
      .def_readonly("face", &EnergyWeights::face)
      .def_readonly("shape", &EnergyWeights::shape)
      .def_readonly("volume", &EnergyWeights::volume)
      .def_readonly("epsilon", &EnergyWeights::epsilon)
      .def_readonly("soft", &EnergyWeights::soft);
  py::class_<EnergyReport>(m, "EnergyReport")
      .def_readonly("energy", &EnergyReport::energy)
      .def_readonly("min_det", &EnergyReport::min_det)
      .def_readonly("min_facing", &EnergyReport::min_facing)
      .def_readonly("folds", &EnergyReport::folds)
      .def_readonly("flips", &EnergyReport::flips);
  const auto ids = [](const std::vector<Index>& found) {
    return IndexVec(Eigen::Map<const IndexVec>(found.data(), static_cast<Index>(found.size())));
  };
  py::class_<HeldUp>(m, "HeldUp")
      .def_property_readonly("tets", [ids](const HeldUp& self) { return ids(self.tets); })
      .def_property_readonly("faces", [ids](const HeldUp& self) { return ids(self.faces); });
  py::class_<NewtonReport>(m, "NewtonReport")
      .def_readonly("before", &NewtonReport::before)
      .def_readonly("after", &NewtonReport::after)
      .def_readonly("decrement", &NewtonReport::decrement)
      .def_readonly("alpha", &NewtonReport::alpha)
      .def_readonly("cg_iterations", &NewtonReport::cg_iterations)
      .def_readonly("negative_curvature", &NewtonReport::negative_curvature)
      .def_readonly("held_up", &NewtonReport::held_up)
      .def_readonly("shift", &NewtonReport::shift);
  py::class_<GlideSurface, std::shared_ptr<GlideSurface>>(m, "GlideSurface")
      .def_property_readonly("area", &GlideSurface::area);
  py::class_<TorusSurface, GlideSurface, std::shared_ptr<TorusSurface>>(m, "TorusSurface")
      .def(py::init<double, double>(), py::arg("R"), py::arg("r"));
  py::class_<MeshSurface, GlideSurface, std::shared_ptr<MeshSurface>>(m, "MeshSurface")
      .def(py::init([](const PointsRef& points, const FacesRef& faces, bool smooth) {
             return std::make_shared<MeshSurface>(points, faces,
                                                  smooth ? MeshAxes::kSmooth : MeshAxes::kFace);
           }),
           py::arg("points").noconvert(), py::arg("faces").noconvert(), py::kw_only(),
           py::arg("smooth_axes"), release_gil());
  py::class_<GlidingBoundary>(m, "GlidingBoundary")
      .def(py::init([](std::shared_ptr<GlideSurface> surface, Faces faces, Rows rest, Vec weights) {
             return GlidingBoundary{std::move(surface), std::move(faces), std::move(rest),
                                    std::move(weights)};
           }),
           py::kw_only(), py::arg("surface"), py::arg("faces"), py::arg("rest"), py::arg("weights"))
      .def("facing", &least_facing, py::arg("x").noconvert(), release_gil());
  py::class_<NewtonOptions>(m, "NewtonOptions")
      .def(py::init([](double tol, int max_cg, bool keep_hessian, double negative) {
             NewtonOptions options;
             options.tol = tol;
             options.max_cg = max_cg;
             options.keep_hessian = keep_hessian;
             options.negative = negative;
             return options;
           }),
           py::kw_only(), py::arg("tol") = NewtonOptions().tol,
           py::arg("max_cg") = NewtonOptions().max_cg, py::arg("keep_hessian") = false,
           py::arg("negative") = 0.0);
  py::class_<SolidNewton>(m, "SolidNewton")
      .def(py::init([](const PointsRef& x, const TetsRef& tets, const RowsRef& rest,
                       const VecRef& weights, const FlagsRef& motion,
                       const std::optional<GlidingBoundary>& boundary) {
             return SolidNewton(SolidEnergy({tets, rest, weights, motion}, x,
                                            boundary.value_or(GlidingBoundary{})));
           }),
           py::arg("x").noconvert(), py::kw_only(), py::arg("tets").noconvert(),
           py::arg("rest").noconvert(), py::arg("weights").noconvert(),
           py::arg("motion").noconvert(), py::arg("boundary") = std::nullopt, release_gil())
      .def(
          "value",
          [](const SolidNewton& self, const PointsRef& x, const EnergyWeights& w) {
            return self.energy().value(x, w);
          },
          py::arg("x").noconvert(), py::arg("weights"), release_gil())
      .def(
          "set_targets",
          [](SolidNewton& self, const VecRef& target) {
            if (target.size() != self.energy().tets() || !(target.array() > 0.0).all())
              throw Error("ArrayError", "a positive target is needed for every tet");
            self.set_targets(target);
          },
          py::arg("target").noconvert(), release_gil())
      .def(
          "step",
          [](SolidNewton& self, Points x, const EnergyWeights& w, const NewtonOptions& options) {
            const NewtonReport report = self.step(x, w, options, signal_poll());
            return std::make_pair(std::move(x), report);
          },
          py::arg("x"), py::arg("weights"), py::arg("options") = NewtonOptions(), release_gil());
  m.def("rest_matrices", &rest_matrices, py::arg("V").noconvert(), py::arg("tets").noconvert(),
        py::arg("max_aspect"), release_gil());
  m.def("rest_triangles", &rest_triangles, py::arg("V").noconvert(), py::arg("faces").noconvert(),
        py::arg("scale"), py::arg("max_aspect") = std::numeric_limits<double>::infinity(),
        release_gil());
}

void bind_rings(py::module_& m) {
  py::class_<RingStep>(m, "RingStep")
      .def_readonly("x", &RingStep::x)
      .def_readonly("error", &RingStep::error)
      .def_readonly("cg_iterations", &RingStep::cg_iterations);
  py::class_<RingProjection>(m, "RingProjection")
      .def(py::init<const TetsRef&, const FlagsRef&>(), py::arg("tets").noconvert(),
           py::arg("fixed").noconvert(), release_gil())
      .def("error", &RingProjection::error, py::arg("x").noconvert(), py::arg("target"),
           release_gil())
      .def(
          "step",
          [](const RingProjection& self, const PointsRef& x, const VecRef& target, double tol,
             int max_cg) { return self.step(x, target, tol, max_cg, signal_poll()); },
          py::arg("x").noconvert(), py::arg("target"), py::arg("tol") = 1e-6,
          py::arg("max_cg") = 2000, release_gil());
}

void bind_levels(py::module_& m) {
  m.def("level_histogram", &level_histogram, py::arg("tets").noconvert(),
        py::arg("values").noconvert(), py::arg("amounts").noconvert(), py::arg("bins"),
        py::arg("period"), py::arg("periodic"), release_gil());
  m.def("level_lookup", &level_lookup, py::arg("tets").noconvert(), py::arg("values").noconvert(),
        py::arg("table").noconvert(), py::arg("period"), py::arg("periodic"), release_gil());
}

}  // namespace

void bind(py::module_& m) {
  bind_stretch(m);
  bind_newton(m);
  bind_rings(m);
  bind_levels(m);
}

}  // namespace stretchmap::volume
