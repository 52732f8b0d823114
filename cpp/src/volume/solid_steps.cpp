// How far a step of SolidEnergy goes, and where it leads.
#include <algorithm>
#include <cmath>

#include "stretchmap/base/parallel.hpp"
#include "stretchmap/volume/line_bound.hpp"
#include "stretchmap/volume/solid_energy.hpp"

namespace stretchmap::volume {
namespace {

using Eigen::Vector3d;

// What is taken of the way to where a tet turns over, and so how far ahead that has to be looked
// for.
constexpr double kShare = 0.9, kWholeStep = 1.0 / kShare;
constexpr int kHoldingPasses = 6;
constexpr int kEasingPasses = 6;
constexpr double kEasing = 0.25;  // what is left of a step at the vertices of an element it harms
// Elements that hold up all others, at most, where their own steps are worth a look: with more, it
// is a matter of the whole, and of hundreds of tries none was seen to lead lower.
constexpr std::size_t kSingle = 20;

}  // namespace

Points SolidEnergy::move(const PointsRef& x, const PointsRef& step, double alpha) const {
  Points moved = x;
  const Index n_rows = rows();
  for_rows(n_rows, kCostlyChunk, [&](Index row) {
    const Index i = row_vertex_[row];
    if (motion_[i] != kGliding) {
      moved.row(i) += alpha * step.row(row);
      return;
    }
    const GlideSurface& surface = barrier_.surface();
    const Vector3d from = x.row(i).transpose();
    const Eigen::Vector2d along = alpha * step.row(row).head<2>().transpose();
    const Index at = surface.place(from, site_place_[site_number_[i]]);
    moved.row(i) = surface.moved(from, at, along).transpose();
  });
  return moved;
}

Points SolidEnergy::in_space(const PointsRef& x, const PointsRef& step) const {
  Points direction = Points::Zero(x.rows(), 3);
  const Index n_rows = rows();
  const GlideSites at = sites(x, true);
  for_rows(n_rows, kCostlyChunk, [&](Index row) {
    direction.row(row_vertex_[row]) =
        (frame(at, row_vertex_[row]) * step.row(row).transpose()).transpose();
  });
  return direction;
}

double SolidEnergy::longest_step(const PointsRef& x, const PointsRef& step) const {
  return std::min(1.0, kShare * longest_steps(tets_, x, in_space(x, step), kWholeStep).minCoeff());
}

std::optional<Points> SolidEnergy::held_back(const PointsRef& x, const PointsRef& step) const {
  Points direction = in_space(x, step), shortened = step;
  for (int pass = 0; pass < kHoldingPasses; ++pass) {
    const Vec longest = longest_steps(tets_, x, direction, kWholeStep);
    const auto held = static_cast<std::size_t>((longest.array() < kWholeStep).count());
    if (held > kSingle || (held == 0 && pass == 0)) return std::nullopt;
    if (held == 0) break;
    Vec share = Vec::Ones(x.rows());
    for (Index t = 0; t < longest.size(); ++t) {
      if (longest[t] >= kWholeStep) continue;
      for (int a = 0; a < 4; ++a)
        share[tets_(t, a)] = std::min(share[tets_(t, a)], kShare * kShare * longest[t]);
    }
    direction.array().colwise() *= share.array();
    for (Index row = 0; row < rows(); ++row) shortened.row(row) *= share[row_vertex_[row]];
  }
  return shortened;
}

EasedStep SolidEnergy::eased(const PointsRef& x, const PointsRef& step, const EnergyWeights& w,
                             double most, double enough) const {
  EasedStep best;
  const bool bent = barrier_.size() > 0 && !barrier_.surface().smooth();
  Energies before = energies(x, w);
  const double goal = summed(before).energy - enough;
  before.det.resize(0);
  Points shortened = step;
  Energies after = energies(move(x, shortened, 1.0), w);
  for (int pass = 0; pass < kEasingPasses; ++pass) {
    HeldUp at = harmed(before, after, most);
    if (at.size() == 0 || (at.size() > kSingle && !bent)) break;
    shorten(at, shortened);
    if (pass == 0 && at.size() <= kSingle) {
      best.held_up = std::move(at);
      for (Index& t : best.held_up.tets) t = order_[t];
    }
    Points image = move(x, shortened, 1.0);
    after = {};  // before there are others
    after = energies(image, w);
    const EnergyReport there = summed(after);
    if (!(there.energy < best.there.energy)) continue;
    best.step = shortened;
    best.image = std::move(image);
    best.there = there;
    if (there.energy < goal) break;
  }
  return best;
}

// The elements whose energy rises by more than `most`, as they are numbered here.
HeldUp SolidEnergy::harmed(const Energies& before, const Energies& after, double most) {
  HeldUp found;
  for (Index t = 0; t < before.tets.size(); ++t)
    if (!(after.tets[t] - before.tets[t] <= most)) found.tets.push_back(t);
  for (Index f = 0; f < before.faces.size(); ++f)
    if (!(after.faces[f] - before.faces[f] <= most)) found.faces.push_back(f);
  return found;
}

// A share of the step at their vertices.
void SolidEnergy::shorten(const HeldUp& at, Points& step) const {
  Flags harmed = Flags::Zero(motion_.size());
  for (const Index t : at.tets)
    for (const Index i : tets_.row(t)) harmed[i] = 1;
  for (const Index f : at.faces)
    for (const Index i : barrier_.faces().row(f)) harmed[i] = 1;
  for (Index row = 0; row < rows(); ++row)
    if (harmed[row_vertex_[row]]) step.row(row) *= kEasing;
}

Rows SolidEnergy::near_nullspace(const PointsRef& x) const {
  Rows modes(3 * rows(), 3);
  const GlideSites at = sites(x, true);
  for (Index row = 0; row < rows(); ++row)
    modes.middleRows<3>(3 * row) = frame(at, row_vertex_[row]).transpose();
  return modes;
}

}  // namespace stretchmap::volume
