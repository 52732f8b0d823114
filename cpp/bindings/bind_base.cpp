#include "arrays.hpp"

#ifdef _OPENMP
#include <omp.h>
#endif

namespace stretchmap::base {

void bind(py::module_& m) {
#ifdef _OPENMP
  m.def("thread_count", &omp_get_max_threads);
  m.def("set_thread_count", &omp_set_num_threads, py::arg("count"));
#else
  m.def("thread_count", [] { return 1; });
  m.def(
      "set_thread_count", [](int) {}, py::arg("count"));
#endif
}

}  // namespace stretchmap::base
