#include "stretchmap/area/surface_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/torus.hpp"
#include "stretchmap/certificate/torus_graph.hpp"

namespace stretchmap::area {

namespace {

constexpr double kArmijo = 1e-4;
constexpr double kRingGoal = 1e-10;  // deviation of the ring ratios that counts as exact
constexpr int kBestSteps = 2;        // towards it, of each kind
constexpr int kStiffSteps = 6;
constexpr double kGain = 1e-2;  // of a step after which its factor serves again
constexpr int kHalvings = 30;
constexpr double kRidge = 1e-9;  // of the mean diagonal: holds the rotation about the axis

Points2 as_rows(const Vec& vector) {
  return Eigen::Map<const Points2>(vector.data(), vector.size() / 2, 2);
}

// Rotations about the axis cost nothing; without this rounding decides how far they go.
Points2 without_rotation(Points2 direction) {
  direction.col(0).array() -= direction.col(0).mean();
  return direction;
}

std::vector<Index> flipped(const GlideProblem& problem, const Points2& angles) {
  const Vec areas = turn_areas(problem.chart, angles / kTwoPi);
  std::vector<Index> faces;
  for (Index f = 0; f < areas.size(); ++f)
    if (!(areas(f) > 0.0)) faces.push_back(f);
  return faces;
}

}  // namespace

SurfaceNewton::SurfaceNewton(GlideProblem problem, Points2 angles)
    : problem_(std::move(problem)),
      angles_(std::move(angles)),
      pattern_(problem_.chart.faces, problem_.chart.n_vertices, 2) {
  const std::vector<Index> faces = flipped(problem_, angles_);
  if (!faces.empty())
    throw Error("SolverError", "faces are flipped in the chart; Newton steps need a start without",
                faces);
}

GlideStep SurfaceNewton::step(const SurfaceWeights& weights, const Poll& poll) {
  const double scale = best_scale(problem_, angles_);
  const GlideEnergy here = glide_energy(problem_, weights, scale, angles_, Derivatives::kModel);
  if (poll) poll();
  factorize(here.hessians, poll);
  const Vec flat = solver_->solve(-here.gradient);
  const Points2 direction = without_rotation(as_rows(flat));

  const double slope = here.gradient.dot(flat);
  GlideStep result{here.value, here.value, 0.0, -slope};
  double t = longest_step(direction);
  for (int halving = 0; halving < kHalvings; ++halving, t *= 0.5) {
    if (poll) poll();
    const Points2 trial = angles_ + t * direction;
    const double value = glide_energy(problem_, weights, scale, trial, Derivatives::kNone).value;
    if (!(value <= here.value + kArmijo * t * slope) || !flipped(problem_, trial).empty()) continue;
    angles_ = trial;
    result.after = value;
    result.step = t;
    break;
  }
  return result;
}

void SurfaceNewton::factorize(const Rows& hessians, const Poll& poll) {
  SparseMatrix matrix = pattern_.zeros();
  pattern_.scatter(hessians, matrix.valuePtr());
  const double ridge = kRidge * Vec(matrix.diagonal()).mean();
  for (Index i = 0; i < matrix.rows(); ++i) matrix.coeffRef(i, i) += ridge;
  if (!solver_) solver_.emplace(matrix);
  solver_->factorize(matrix, poll);
}

// At most 1, and at most nine tenths of the way to the first face of no area in the (u, v) chart.
double SurfaceNewton::longest_step(const Points2& direction) const {
  return unfolded_step(problem_.chart, angles_ / kTwoPi, direction / kTwoPi, 0.9, 1.0);
}

bool SurfaceNewton::project_rings(const SurfaceWeights& weights, double face_sd, double face_error,
                                  const Poll& poll) {
  if (!rings_) rings_.emplace(problem_.chart.faces, problem_.chart.n_vertices);
  const Points2 start = angles_;
  const SurfaceFigures before = figures();
  const auto take = [&](RingStep kind) {
    if (poll) poll();
    const Points2 direction = without_rotation(
        rings_->step(problem_, weights, best_scale(problem_, angles_), angles_, kind, poll));
    angles_ += longest_step(direction) * direction;
    return figures();
  };
  SurfaceFigures now = before;
  try {
    for (int step = 0; step < kBestSteps; ++step) now = take(RingStep::kBest);
    RingStep kind = RingStep::kStiff;
    for (int step = 0; step < kStiffSteps && now.ring_sd > kRingGoal; ++step) {
      const double sd = now.ring_sd;
      now = take(kind);
      kind = now.ring_sd <= kGain * sd ? RingStep::kAgain : RingStep::kStiff;
    }
  } catch (const Error&) {  // singular: nothing to be had
    now.ring_sd = std::numeric_limits<double>::infinity();
  }
  if (now.flips <= before.flips && now.ring_sd <= kRingGoal &&
      now.face_sd <= std::max(before.face_sd, face_sd) &&
      now.face_error <= std::max(before.face_error, face_error))
    return true;
  angles_ = start;
  return false;
}

SurfaceFigures SurfaceNewton::figures() const {
  Vec areas = glide_areas(problem_, angles_);
  const double total = areas.sum();
  areas /= total;
  SurfaceFigures figures;
  const Vec& source = problem_.reference.areas;
  figures.energy = (areas.array().square() / source.array()).sum();
  const Points image = glide_image(problem_, angles_);
  const double R = problem_.torus().R;
  figures.flips =
      static_cast<Index>(certificate::torus_graph(image, problem_.chart.faces, R).bad.size());
  figures.angle_mean = surface_quality(problem_.reference, problem_.chart.faces, image).angle_mean;
  ratio_figures(problem_.chart.faces, problem_.chart.n_vertices, source, areas, figures);
  return figures;
}

}  // namespace stretchmap::area
