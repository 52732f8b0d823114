#include "arrays.hpp"
#include "stretchmap/partitions/split_tets.hpp"

namespace stretchmap::partitions {
void bind(py::module_& m) {
  py::class_<TetSplit>(m, "TetSplit")
      .def_readonly("tets", &TetSplit::tets)
      .def_readonly("slab", &TetSplit::slab)
      .def_readonly("parent", &TetSplit::parent)
      .def_readonly("cut_edges", &TetSplit::cut_edges)
      .def_readonly("cut_level", &TetSplit::cut_level);
  m.attr("EVERYWHERE") = kEverywhere;
  m.def("split_tets", &split_tets, py::arg("tets").noconvert(), py::arg("n_vertices"),
        py::arg("places").noconvert(), py::arg("period"), release_gil());
  m.def("shares_below", &shares_below, py::arg("values").noconvert(), release_gil());
  m.def("volume_below", &volume_below, py::arg("tets").noconvert(), py::arg("volumes").noconvert(),
        py::arg("values").noconvert(), release_gil());
}

}  // namespace stretchmap::partitions
