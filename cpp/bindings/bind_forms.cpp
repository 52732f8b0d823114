#include "arrays.hpp"
#include "stretchmap/forms/cotangent.hpp"
#include "stretchmap/forms/harmonic.hpp"

namespace stretchmap::bindings {

void bind_forms(py::module_& m) {
  m.def("cotangent_weights", &cotangent_weights, py::arg("topology"), py::arg("points").noconvert(),
        release_gil());
  m.def("weighted_laplacian", &weighted_laplacian, py::arg("topology"), py::arg("weights"),
        release_gil());
  m.def(
      "harmonic_forms",
      [](const SurfaceTopology& top, const VecRef& weights, const RowsRef& eta) {
        HarmonicSolution result = harmonic_forms(top, weights, eta);
        return std::make_tuple(std::move(result.forms), std::move(result.potentials),
                               std::move(result.gram));
      },
      py::arg("topology"), py::arg("weights"), py::arg("eta"), release_gil());
}

}  // namespace stretchmap::bindings
