// Projected Newton steps on the energy of a solid map.
#pragma once

#include <memory>
#include <vector>

#include "stretchmap/volume/solid_energy.hpp"

namespace stretchmap::volume {

struct NewtonOptions {
  double tol = 1e-2;  // relative residual asked of the conjugate gradients
  int max_cg = 300;   // more are not spent on one step
  // Keep the Hessian of the last step that was asked to renew it, and correct it by the changes of
  // the gradient since (limited-memory BFGS): several times cheaper, nearly as good while the
  // weights stay the same.
  bool keep_hessian = false;
  // Share of the elements' negative eigenvalues that a new Hessian keeps, see EnergyWeights. Near a
  // minimum pressures are balanced: much of what one element counts as negative its neighbors count
  // as positive. All dropped, the sum is far too stiff; all kept, it is often indefinite. Where it
  // turns out to be, the step is made with 0.
  double negative = 0.0;
};

struct NewtonReport {
  EnergyReport before, after;
  double decrement = 0.0;  // -gradient . step, twice the decrease a quadratic model predicts
  double alpha = 0.0;      // step length taken, 0 if no decrease was found
  int cg_iterations = 0;
  double cg_residual = 0.0;
  bool negative_curvature = false;  // met by the conjugate gradients, which then stopped early
  HeldUp held_up;      // a handful of elements that cut the step short, if it is no more than that
  double shift = 0.0;  // added to the Hessian's diagonal, as a share of it, before a step was found
};

class SolidNewton {
 public:
  explicit SolidNewton(SolidEnergy energy) : energy_(std::move(energy)) {}

  const SolidEnergy& energy() const { return energy_; }

  // SolidEnergy::set_targets between two steps.
  // \param target (k) > 0.
  void set_targets(const VecRef& target) {
    energy_.set_targets(target);
    new_targets_ = true;
    end_.resize(0, 3);
  }

  // One inexact Newton step. The energy never rises, and with
  // epsilon = 0 no tet turns over. A solve that breaks down, or whose direction does not lead down,
  // is tried again with a growing diagonal; if nothing helps, x stays and alpha is 0.
  // \param x (n, 3) replaced.
  // \throws Error "SolverError" if the energy at x is not finite.
  NewtonReport step(Points& x, const EnergyWeights& w, const NewtonOptions& options,
                    const Poll& poll = {});

 private:
  bool search(Points& x, Points& direction, const EnergyWeights& w, const Poll& poll,
              NewtonReport& report);
  void try_double_step(Points& x, const Points& start, const Points& direction,
                       const EnergyWeights& w, NewtonReport& report) const;
  void try_held_back(Points& x, const Points& start, Points& direction, const EnergyWeights& w,
                     NewtonReport& report) const;

  void try_eased(Points& x, const Points& start, Points& direction, const EnergyWeights& w,
                 NewtonReport& report) const;

  // In single precision: it corrects a Hessian that is off by more.
  struct Change {
    Eigen::VectorXf step, gradient;
    double inverse;  // 1 / (step . gradient)
  };

  EnergyReport start_value(const PointsRef& x, const EnergyWeights& w);
  bool renew(const PointsRef& x, const EnergyWeights& w, bool keep);
  bool solve_projected(const PointsRef& x, EnergyWeights w, const NewtonOptions& options,
                       const Poll& poll, Points& direction, NewtonReport& report);
  bool linearize(const PointsRef& x, const EnergyWeights& w);
  bool descend(const NewtonOptions& options, const Poll& poll, Points& direction,
               NewtonReport& report);

  SolidEnergy energy_;
  Points end_;  // of the last step, and the energy there; no rows if it is not known
  EnergyWeights end_weights_;
  EnergyReport end_report_;
  std::unique_ptr<linalg::BlockSolver> solver_;
  double negative_ = 0.0;          // share of negative parts in the Hessian at hand
  bool cut_short_ = false;         // the last step was, and the next begins with a stiffer diagonal
  int projected_ = 0;              // Hessians still to be made without negative parts
  Points gradient_;                // at the current point
  Vec last_gradient_, last_step_;  // before the last step, and the step; empty after a renewal
  std::vector<Change> changes_;    // since the Hessian was renewed
  bool new_targets_ = false;       // so the change of the gradient is not that of the step alone
};

}  // namespace stretchmap::volume
