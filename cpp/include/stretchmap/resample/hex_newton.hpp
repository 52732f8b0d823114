// Newton steps on the energy of a hexahedral grid.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stretchmap/resample/hex_energy.hpp"

namespace stretchmap::resample {

struct HexNewtonOptions {
  int max_steps = 5;
  double least_gain = 1e-3;  // stop when a step lowers the energy by a smaller share
  double tol = 0.1;          // relative residual asked of the conjugate gradients
  int max_cg = 100;
  std::string preconditioner = "multigrid";  // see BlockOptions; that of the first run stays
};

struct HexNewtonReport {
  HexReport before, after;
  int steps = 0, cg_iterations = 0;
};

class HexNewton {
 public:
  HexNewton(const HexesRef& hexes, Index n) : energy_(hexes, n) {}

  HexEnergy& energy() { return energy_; }
  const HexEnergy& energy() const { return energy_; }

  // Inexact Newton steps from x (n, 3), which they replace. The energy never rises, and with
  // epsilon = 0 no corner turns over.
  // \throws SolverError if the energy at x is not finite or a linear solve breaks down.
  HexNewtonReport run(Points& x, const HexWeights& w, const HexNewtonOptions& options,
                      const Poll& poll = {});

 private:
  bool step(Points& x, const HexWeights& w, const HexNewtonOptions& options, const Poll& poll,
            HexNewtonReport& report);

  HexEnergy energy_;
  std::unique_ptr<linalg::BlockSolver> solver_;
};

}  // namespace stretchmap::resample
