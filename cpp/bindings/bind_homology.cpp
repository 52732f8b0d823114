#include "arrays.hpp"
#include "stretchmap/homology/linking.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::bindings {

void bind_homology(py::module_& m) {
  m.def("edge_lengths", &edge_lengths, py::arg("topology"), py::arg("points").noconvert(),
        release_gil());
  m.def(
      "tree_cotree",
      [](const SurfaceTopology& top, const VecRef& length) {
        HomologyGenerators result = tree_cotree(top, length);
        return std::make_pair(std::move(result.loops), std::move(result.forms));
      },
      py::arg("topology"), py::arg("edge_length"), release_gil());
  m.def("periods", &periods, py::arg("topology"), py::arg("forms").noconvert(), py::arg("loop"),
        release_gil());
  m.def("wedge_matrix", &wedge_matrix, py::arg("topology"), py::arg("forms"), release_gil());
  m.def("gauss_linking", &gauss_linking, py::arg("p"), py::arg("q"), release_gil());
  m.def(
      "linking_matrix",
      [](const SurfaceTopology& top, const PointsRef& points, const std::vector<Loop>& loops) {
        return linking_matrix(top, points, loops, signal_poll());
      },
      py::arg("topology"), py::arg("points").noconvert(), py::arg("loops"), release_gil());
}

}  // namespace stretchmap::bindings
