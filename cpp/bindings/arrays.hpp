// What every binding file needs: casters, the poll that keeps Ctrl-C alive, release of the GIL.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/types.hpp"

namespace py = pybind11;

namespace stretchmap {

// To be handed to long loops that run without the GIL: turns a pending Ctrl-C into an exception.
inline Poll signal_poll() {
  return [] {
    py::gil_scoped_acquire lock;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  };
}

using release_gil = py::call_guard<py::gil_scoped_release>;

}  // namespace stretchmap
