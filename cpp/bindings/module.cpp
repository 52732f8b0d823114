// The extension module: one submodule per room, and the translation of core errors.
#include "arrays.hpp"

namespace stretchmap::base {
void bind(py::module_& m);
}
namespace stretchmap::mesh {
void bind(py::module_& m);
}
namespace stretchmap::forms {
void bind(py::module_& m);
}
namespace stretchmap::homology {
void bind(py::module_& m);
}
namespace stretchmap::linalg {
void bind(py::module_& m);
}
namespace stretchmap::measures {
void bind(py::module_& m);
}
namespace stretchmap::maps {
void bind(py::module_& m);
}
namespace stretchmap::certificate {
void bind(py::module_& m);
}
namespace stretchmap::partitions {
void bind(py::module_& m);
}
namespace stretchmap::area {
void bind(py::module_& m);
}
namespace stretchmap::volume {
void bind(py::module_& m);
}
namespace stretchmap::energies {
void bind(py::module_& m);
}
namespace stretchmap::registration {
void bind(py::module_& m);
}
namespace stretchmap::resample {
void bind(py::module_& m);
}
namespace stretchmap::testing {
void bind(py::module_& m);
}

PYBIND11_MODULE(_core, m) {
  m.doc() = "C++ core of stretchmap; private, its arguments are validated by the Python layer.";

  // NOLINTNEXTLINE(performance-unnecessary-value-param): the signature is pybind11's.
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const stretchmap::Error& error) {
      const py::object type = py::module_::import("stretchmap.errors").attr(error.kind.c_str());
      const py::object value = type(error.what(), py::arg("ids") = error.ids);
      PyErr_SetObject(type.ptr(), value.ptr());
    }
  });

  const auto room = [&](const char* name, void (*bind)(py::module_&)) {
    py::module_ inner = m.def_submodule(name);
    bind(inner);
  };
  room("base", stretchmap::base::bind);
  room("mesh", stretchmap::mesh::bind);
  room("forms", stretchmap::forms::bind);
  room("homology", stretchmap::homology::bind);
  room("linalg", stretchmap::linalg::bind);
  room("measures", stretchmap::measures::bind);
  room("maps", stretchmap::maps::bind);
  room("certificate", stretchmap::certificate::bind);
  room("partitions", stretchmap::partitions::bind);
  room("area", stretchmap::area::bind);
  room("volume", stretchmap::volume::bind);
  room("energies", stretchmap::energies::bind);
  room("registration", stretchmap::registration::bind);
  room("resample", stretchmap::resample::bind);
  room("testing", stretchmap::testing::bind);
}
