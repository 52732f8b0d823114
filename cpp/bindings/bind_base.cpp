#include "arrays.hpp"

#ifdef _OPENMP
#include <omp.h>
#endif

#include <algorithm>

namespace stretchmap::base {

namespace {

#ifdef _OPENMP
// Set in the one thread that a forked process begins with: the OpenMP runtime still believes that
// the parent's pool of threads belongs to it, and would wait for them for ever.
thread_local bool after_fork = false;

void set_thread_count(int count) { omp_set_num_threads(after_fork ? 1 : std::max(count, 1)); }

void keep_to_one_thread() {
  after_fork = true;
  omp_set_num_threads(1);
}

int thread_count() { return omp_get_max_threads(); }
int openmp_version() { return _OPENMP; }
#else
void set_thread_count(int) {}
void keep_to_one_thread() {}
int thread_count() { return 1; }
int openmp_version() { return 0; }
#endif

}  // namespace

void bind(py::module_& m) {
  m.def("thread_count", &thread_count);
  m.def("openmp_version", &openmp_version);  // year and month of its standard, 0 without it
  m.def("set_thread_count", &set_thread_count, py::arg("count"));
  m.def("keep_to_one_thread", &keep_to_one_thread);
}

}  // namespace stretchmap::base
