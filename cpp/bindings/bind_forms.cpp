#include "arrays.hpp"
#include "stretchmap/forms/cotangent.hpp"
#include "stretchmap/forms/harmonic.hpp"
#include "stretchmap/forms/hodge.hpp"
#include "stretchmap/forms/intrinsic_delaunay.hpp"

namespace stretchmap::forms {
void bind(py::module_& m) {
  m.def("cotangent_weights", &cotangent_weights, py::arg("topology"), py::arg("points").noconvert(),
        release_gil());
  m.def(
      "harmonic_forms",
      [](Index n_vertices, const EdgesRef& edges, const VecRef& weights, const RowsRef& eta) {
        HarmonicSolution result = harmonic_forms(n_vertices, edges, weights, eta);
        return std::make_tuple(std::move(result.forms), std::move(result.potentials),
                               std::move(result.gram));
      },
      py::arg("n_vertices"), py::arg("edges").noconvert(), py::arg("weights"), py::arg("eta"),
      release_gil());
  m.def(
      "hodge_products",
      [](const mesh::SurfaceTopology& top, const PointsRef& points, const RowsRef& forms) {
        HodgeProducts products = hodge_products(top, points, forms);
        return std::make_pair(std::move(products.star), std::move(products.wedge));
      },
      py::arg("topology"), py::arg("points").noconvert(), py::arg("forms"), release_gil());
  m.def("chart_areas", &chart_areas, py::arg("topology"), py::arg("first"), py::arg("second"),
        release_gil());
  m.def(
      "intrinsic_delaunay",
      [](const mesh::SurfaceTopology& top, const VecRef& edge_length,
         const Eigen::Ref<const IndexRows>& eta) {
        IntrinsicDelaunay result = intrinsic_delaunay(top, edge_length, eta);
        return std::make_tuple(std::move(result.edges), std::move(result.weights),
                               std::move(result.eta), result.n_flips);
      },
      py::arg("topology"), py::arg("edge_length"), py::arg("eta").noconvert(), release_gil());
}

}  // namespace stretchmap::forms
