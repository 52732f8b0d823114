#include "arrays.hpp"
#include "stretchmap/homology/linking.hpp"
#include "stretchmap/homology/shortest_cycles.hpp"
#include "stretchmap/homology/shortest_loop.hpp"
#include "stretchmap/homology/solid_cohomology.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {
void bind(py::module_& m) {
  m.def(
      "tree_cotree",
      [](const mesh::SurfaceTopology& top, const VecRef& length) {
        HomologyGenerators result = tree_cotree(top, length);
        return std::make_pair(std::move(result.loops), std::move(result.forms));
      },
      py::arg("topology"), py::arg("edge_length"), release_gil());
  m.def("periods", &periods, py::arg("topology"), py::arg("forms").noconvert(), py::arg("loop"),
        release_gil());
  m.def("wedge_matrix", &wedge_matrix, py::arg("topology"), py::arg("forms"), release_gil());
  m.def(
      "linking_matrix",
      [](const mesh::SurfaceTopology& top, const PointsRef& points,
         const std::vector<Loop>& loops) {
        return linking_matrix(top, points, loops, signal_poll());
      },
      py::arg("topology"), py::arg("points").noconvert(), py::arg("loops"), release_gil());
  m.def(
      "shortest_loop",
      [](const mesh::SurfaceTopology& top, const VecRef& length,
         const Eigen::Ref<const IndexRows>& forms, const IndexVec& target, const Loop& crossing,
         double limit, std::int64_t most_settled) {
        return shortest_loop(top, length, forms, target, crossing, signal_poll(), limit,
                             most_settled);
      },
      py::arg("topology"), py::arg("edge_length"), py::arg("forms").noconvert(), py::arg("target"),
      py::arg("crossing"), py::arg("limit") = std::numeric_limits<double>::infinity(),
      py::arg("most_settled") = std::numeric_limits<std::int64_t>::max(), release_gil());
  m.def(
      "shortest_cycles",
      [](const mesh::SurfaceTopology& top, const VecRef& length, const std::vector<Loop>& loops,
         const IndexVec& multiples) {
        return shortest_cycles(top, length, loops, multiples, signal_poll());
      },
      py::arg("topology"), py::arg("edge_length"), py::arg("loops"), py::arg("multiples"),
      release_gil());
  m.def(
      "tree_loops",
      [](const mesh::SurfaceTopology& top, const VecRef& length,
         const Eigen::Ref<const MarkRows>& marks, const std::vector<Index>& roots,
         double limit) { return tree_loops(top, length, marks, roots, limit, signal_poll()); },
      py::arg("topology"), py::arg("edge_length"), py::arg("marks").noconvert(), py::arg("roots"),
      py::arg("limit"), release_gil());
  m.def("joined_loops", &joined_loops, py::arg("topology"), py::arg("edge_length"),
        py::arg("loops"), release_gil());
  m.def(
      "solid_cohomology",
      [](const TetsRef& tets, const EdgesRef& edges, Index n_vertices,
         const std::vector<Loop>& loops) {
        SolidCohomology result = solid_cohomology(tets, edges, n_vertices, loops, signal_poll());
        return std::make_pair(std::move(result.relations), std::move(result.loop_values));
      },
      py::arg("tets").noconvert(), py::arg("edges").noconvert(), py::arg("n_vertices"),
      py::arg("loops"), release_gil());
}

}  // namespace stretchmap::homology
