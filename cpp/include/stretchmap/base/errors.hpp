// Exceptions of the core. `kind` names the Python class the bindings raise (stretchmap.errors).
#pragma once

#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stretchmap/base/types.hpp"

namespace stretchmap {

class Error : public std::runtime_error {
 public:
  Error(std::string kind_, const std::string& message, std::vector<Index> ids_ = {})
      : std::runtime_error(message), kind(std::move(kind_)), ids(std::move(ids_)) {}
  std::string kind;        // "NonManifoldError", "SolverError", ...
  std::vector<Index> ids;  // offending vertices, faces or tets
};

// A number for a message, with its order of magnitude.
inline std::string scientific(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1e", value);
  return text;
}

}  // namespace stretchmap
