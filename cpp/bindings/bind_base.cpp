#include "arrays.hpp"
#include "stretchmap/base/memory.hpp"
#include "stretchmap/base/threads.hpp"

namespace stretchmap::base {

void bind(py::module_& m) {
  m.def("processors", &processors, py::arg("groups") = "/sys/fs/cgroup");
  m.def("thread_count", &thread_count);
  m.def("set_thread_count", &set_thread_count, py::arg("count"));
  m.def("keep_to_one_thread", &keep_to_one_thread);
  m.def("shared_seconds", &shared_seconds);
  m.def("helper_seconds", &helper_seconds);
  m.def("give_free_memory_back", &give_free_memory_back, py::call_guard<py::gil_scoped_release>());
}

}  // namespace stretchmap::base
