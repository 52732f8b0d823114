// The extension module: one bind_<stage> per stage, and the translation of core errors.
#include "arrays.hpp"

namespace stretchmap::bindings {
void bind_forms(py::module_& m);
void bind_homology(py::module_& m);
void bind_mesh(py::module_& m);
void bind_volume(py::module_& m);
void bind_linalg(py::module_& m);
void bind_distortion(py::module_& m);
void bind_area(py::module_& m);
void bind_certificate(py::module_& m);
void bind_apply(py::module_& m);
void bind_threads(py::module_& m);
}  // namespace stretchmap::bindings

PYBIND11_MODULE(_core, m) {
  using namespace stretchmap::bindings;
  m.doc() = "C++ core of stretchmap; private, its arguments are validated by the Python layer.";

  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const stretchmap::Error& error) {
      const py::object type = py::module_::import("stretchmap.errors").attr(error.kind.c_str());
      const py::object value = type(error.what(), py::arg("ids") = error.ids);
      PyErr_SetObject(type.ptr(), value.ptr());
    }
  });

  bind_mesh(m);
  bind_volume(m);
  bind_homology(m);
  bind_forms(m);
  bind_linalg(m);
  bind_distortion(m);
  bind_area(m);
  bind_certificate(m);
  bind_apply(m);
  bind_threads(m);
}
