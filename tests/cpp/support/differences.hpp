// Derivatives by central differences, to compare hand-written ones with.
#pragma once

#include <Eigen/Core>

namespace stretchmap::tests {

// d/dt of a number or a vector f(t) at zero.
template <class Function>
auto slope(const Function& f, double h) {
  const auto plus = f(h), minus = f(-h);
  using Value = std::decay_t<decltype(plus)>;
  return Value((plus - minus) / (2.0 * h));
}

// Largest difference of two matrices over the largest entry of the second.
template <class A, class B>
double relative_error(const A& a, const B& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

}  // namespace stretchmap::tests
