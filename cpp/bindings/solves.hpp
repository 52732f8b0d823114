// What the bindings of linear solvers share.
#pragma once

#include "arrays.hpp"
#include "stretchmap/linalg/spd_solver.hpp"

namespace stretchmap::linalg {

inline SolveOptions solve_options(double tol, int max_iter, bool must_converge) {
  return {tol, max_iter, must_converge};
}

inline void set_values(double* target, Eigen::Index size, const VecRef& values) {
  if (values.size() != size) throw Error("SolverError", "the pattern has another number of values");
  Eigen::Map<Vec>(target, size) = values;
}

}  // namespace stretchmap::linalg
