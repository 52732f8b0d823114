#include "arrays.hpp"
#include "stretchmap/stretch/rest_shape.hpp"
#include "stretchmap/stretch/ring_projection.hpp"
#include "stretchmap/stretch/solid_newton.hpp"
#include "stretchmap/stretch/tet_laplacian.hpp"
#include "stretchmap/stretch/volumetric_stretch.hpp"

namespace stretchmap::bindings {

namespace {

SolveOptions solve_options(double tol, int max_iter) {
  SolveOptions options;
  options.tol = tol;
  options.max_iter = max_iter;
  return options;
}

}  // namespace

void bind_volume(py::module_& m) {
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
          [](VolumetricStretch& self, Points x, double c, double tol, int max_iter) {
            const auto report = self.step(x, c, solve_options(tol, max_iter), signal_poll());
            return std::make_pair(std::move(x), report);
          },
          py::arg("x"), py::arg("c"), py::arg("tol") = 1e-10, py::arg("max_iter") = 1000,
          release_gil());
  m.def(
      "tet_laplacian",
      [](const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest, const PointsRef& geometry,
         double c, const PointsRef& x, int lanes) {
        TetLaplacian laplacian(tets, fixed, rest, lanes);
        SparseMatrix matrix = laplacian.pattern();
        Points rhs;
        laplacian.assemble(geometry, c, x, matrix, rhs);
        return std::make_tuple(std::move(matrix), std::move(rhs), laplacian.interior());
      },
      py::arg("tets").noconvert(), py::arg("fixed").noconvert(), py::arg("rest"),
      py::arg("geometry").noconvert(), py::arg("c"), py::arg("x").noconvert(), py::arg("lanes") = 8,
      "L_II, -L_IB x_B and the vertex of each row, for checks.");
  py::class_<EnergyWeights>(m, "EnergyWeights")
      .def(py::init([](double shape, double volume, double epsilon, double face) {
             return EnergyWeights{shape, volume, epsilon, face};
           }),
           py::arg("shape"), py::arg("volume"), py::arg("epsilon") = 0.0, py::arg("face") = 0.0)
      .def_readonly("face", &EnergyWeights::face)
      .def_readonly("shape", &EnergyWeights::shape)
      .def_readonly("volume", &EnergyWeights::volume)
      .def_readonly("epsilon", &EnergyWeights::epsilon);
  py::class_<EnergyReport>(m, "EnergyReport")
      .def_readonly("energy", &EnergyReport::energy)
      .def_readonly("min_det", &EnergyReport::min_det)
      .def_readonly("min_facing", &EnergyReport::min_facing)
      .def_readonly("folds", &EnergyReport::folds)
      .def_readonly("flips", &EnergyReport::flips);
  py::class_<NewtonReport>(m, "NewtonReport")
      .def_readonly("before", &NewtonReport::before)
      .def_readonly("after", &NewtonReport::after)
      .def_readonly("decrement", &NewtonReport::decrement)
      .def_readonly("gradient_norm", &NewtonReport::gradient_norm)
      .def_readonly("alpha", &NewtonReport::alpha)
      .def_readonly("cg_iterations", &NewtonReport::cg_iterations)
      .def_readonly("negative_curvature", &NewtonReport::negative_curvature)
      .def_readonly("cg_residual", &NewtonReport::cg_residual);

  py::class_<SolidNewton>(m, "SolidNewton")
      .def(
          py::init([](const TetsRef& tets, const RowsRef& rest, const VecRef& weights,
                      const FlagsRef& motion, double R, double r, const PointsRef& x,
                      const FacesRef& faces, const RowsRef& face_rest, const VecRef& face_weights) {
            return SolidNewton(SolidEnergy(tets, rest, weights, motion, R, r, x,
                                           BoundaryBarrier(faces, face_rest, face_weights, R, r)));
          }),
          py::arg("tets").noconvert(), py::arg("rest").noconvert(), py::arg("weights").noconvert(),
          py::arg("motion").noconvert(), py::arg("R"), py::arg("r"), py::arg("x").noconvert(),
          py::arg("faces").noconvert(), py::arg("face_rest").noconvert(),
          py::arg("face_weights").noconvert(), release_gil())
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
          [](SolidNewton& self, Points x, const EnergyWeights& w, double tol, int max_cg,
             bool keep_hessian) {
            NewtonOptions options;
            options.keep_hessian = keep_hessian;
            options.tol = tol;
            options.max_cg = max_cg;
            const NewtonReport report = self.step(x, w, options, signal_poll());
            return std::make_pair(std::move(x), report);
          },
          py::arg("x"), py::arg("weights"), py::arg("tol") = 1e-2, py::arg("max_cg") = 300,
          py::arg("keep_hessian") = false, release_gil());

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

  m.def(
      "element_energy",
      [](const Eigen::Matrix3d& J, const EnergyWeights& w) {
        ElementBatch batch;
        for (int l = 0; l < kLanes; ++l) {
          for (int k = 0; k < 9; ++k) {
            batch.edges[k][l] = J.data()[k];
            batch.rest[k][l] = k % 4 == 0 ? 1.0 : 0.0;
          }
          batch.weight[l] = 1.0;
        }
        element_hessians(batch, w);
        Eigen::Matrix3d P;
        Eigen::Matrix<double, 9, 9> H;
        for (int k = 0; k < 9; ++k) P.data()[k] = batch.gradient[k][0];
        int at = 0;
        for (int a = 0; a < 3; ++a)
          for (int b = a; b < 3; ++b, ++at)
            for (int i = 0; i < 3; ++i)
              for (int j = 0; j < 3; ++j)
                H(3 * a + i, 3 * b + j) = H(3 * b + j, 3 * a + i) = batch.block[at][3 * i + j][0];
        return std::make_tuple(batch.energy[0], P, H);
      },
      py::arg("J"), py::arg("weights"), "Energy, gradient and projected Hessian of one tet.");
  m.def("rest_triangles", &rest_triangles, py::arg("V").noconvert(), py::arg("faces").noconvert(),
        py::arg("scale"), release_gil());
  m.def(
      "face_energy",
      [](const PointsRef& x, const FacesRef& faces, const RowsRef& rest, double R, double r,
         double epsilon) {
        const BoundaryBarrier barrier(faces, rest, Vec::Ones(faces.rows()), R, r);
        Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
        Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();
        barrier.linearise(x, 0, epsilon, gradient, hessian);
        return std::make_tuple(barrier.value(x, 0, epsilon).energy, gradient, hessian);
      },
      py::arg("x").noconvert(), py::arg("faces").noconvert(), py::arg("rest").noconvert(),
      py::arg("R"), py::arg("r"), py::arg("epsilon"),
      "Energy, gradient and model Hessian of the first boundary triangle, for checks.");
  m.def("rest_matrices", &rest_matrices, py::arg("V").noconvert(), py::arg("tets").noconvert(),
        py::arg("max_aspect"), release_gil());
  m.def("signed_tet_volumes", &signed_tet_volumes, py::arg("x").noconvert(),
        py::arg("tets").noconvert(), release_gil());
  m.def("tet_stretch_energy", &tet_stretch_energy, py::arg("image_volumes"),
        py::arg("rest_volumes"), release_gil());
  m.def("tet_stretch_gradient", &tet_stretch_gradient, py::arg("image").noconvert(),
        py::arg("tets").noconvert(), py::arg("rest_volumes"), release_gil());
}

}  // namespace stretchmap::bindings
