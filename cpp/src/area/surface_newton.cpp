#include "stretchmap/area/surface_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/base/torus.hpp"
#include "stretchmap/certificate/torus_graph.hpp"
#include "stretchmap/linalg/backtrack.hpp"

namespace stretchmap::area {

namespace {

constexpr double kRingGoal = 1e-10;  // deviation of the ring ratios that counts as exact
constexpr int kRingSteps = 20;       // towards it at most
constexpr int kWorth = 8;            // steps a factor is kept for: a new one costs as much
constexpr double kSlack = 1.2;       // the steps that follow those best for the faces gain at most
constexpr int kGlideTries = 30;
constexpr double kLeastCurvature = 0.1;  // where steps are as long as they may be
constexpr double kHoldRotation = 1e-9;   // of the mean diagonal: holds the rotation about the axis

Points2 as_rows(const Vec& vector) {
  return Eigen::Map<const Points2>(vector.data(), vector.size() / 2, 2);
}

// Whether `kWorth` more steps that gain what the last one did suffice.
bool nearly_exact(double before, double after) {
  return after * std::pow(after / before, kWorth) <= kRingGoal;
}

// Rotations about the axis cost nothing; without this rounding decides how far they go.
Points2 without_rotation(Points2 direction) {
  direction.col(0).array() -= direction.col(0).mean();
  return direction;
}

}  // namespace

SurfaceNewton::SurfaceNewton(GlideProblem problem, Points2 angles, Flags held)
    : problem_(std::move(problem)),
      angles_(std::move(angles)),
      held_(std::move(held)),
      damping_(Eigen::Vector2d(problem_.ratio, 1.0), kTwoPi) {
  const std::vector<Index> faces = folded_faces(problem_.chart, angles_ / kTwoPi);
  if (!faces.empty())
    throw Error("SolverError", "faces are flipped in the chart; Newton steps need a start without",
                faces);
}

NewtonStep SurfaceNewton::step(const SurfaceWeights& weights, const Poll& poll) {
  const double scale = best_scale(problem_, angles_);
  GlideEnergy here =
      glide_energy(problem_, weights, scale, angles_, Derivatives::kModel, curvature_);
  rings_.reset();
  const auto solve = [&](const Rows& hessians) {
    ++solves_;
    return direction_of(hessians, here.gradient, poll);
  };
  const auto [direction, longest] = damping_.direction(
      problem_.chart, angles_ / kTwoPi, problem_.reference.weights, here.hessians, solve);

  const double slope = here.gradient.dot(Eigen::Map<const Vec>(direction.data(), direction.size()));
  NewtonStep result{here.value, here.value, 0.0, -slope};
  Points2 trial;
  double there = here.value;
  result.step = linalg::backtrack(here.value, slope, longest, kGlideTries, [&](double t) {
    if (poll) poll();
    trial = angles_ + t * direction;
    there = glide_energy(problem_, weights, scale, trial, Derivatives::kNone).value;
    const bool sound = folded_faces(problem_.chart, trial / kTwoPi).empty();
    return sound ? there : std::numeric_limits<double>::infinity();
  });
  curvature_ = result.step == longest ? std::max(0.5 * curvature_, kLeastCurvature)
                                      : std::min(2.0 * curvature_, kModelCurvature);
  if (result.step > 0.0) {
    angles_ = std::move(trial);
    result.after = there;
  }
  return result;
}

// Without rows and columns of vertices that are held: the ridge is left of them.
Points2 SurfaceNewton::direction_of(const Rows& hessians, const Vec& gradient, const Poll& poll) {
  if (held_.size() == 0) return without_rotation(as_rows(system().solve(hessians, gradient, poll)));
  Rows free = hessians;
  Vec pull = gradient;
  const Faces& faces = problem_.chart.faces;
  for_rows(static_cast<Index>(free.rows()), kElementChunk, [&](Index f) {
    Eigen::Map<Eigen::Matrix<double, 6, 6>> hessian(free.row(f).data());
    for (int k = 0; k < 3; ++k) {
      if (!held_(faces(f, k))) continue;
      hessian.middleRows<2>(2 * k).setZero();
      hessian.middleCols<2>(2 * k).setZero();
    }
  });
  for (Index i = 0; i < held_.size(); ++i)
    if (held_(i)) pull.segment<2>(2 * i).setZero();
  return as_rows(system().solve(free, pull, poll));
}

ChartSystem& SurfaceNewton::system() {
  if (!system_) system_.emplace(problem_.chart.faces, problem_.chart.n_vertices, kHoldRotation);
  return *system_;
}

double SurfaceNewton::flops() { return system().flops(); }

// At most 1, and at most nine tenths of the way to the first face of no area in the (u, v) chart.
double SurfaceNewton::longest_step(const Points2& direction) const {
  return unfolded_step(problem_.chart, angles_ / kTwoPi, direction / kTwoPi, 0.9, 1.0);
}

bool SurfaceNewton::project_rings(const SurfaceWeights& weights, double face_std, double face_error,
                                  int least_best, int most_best, const Poll& poll) {
  system_.reset();
  if (!rings_) rings_.emplace(problem_.chart.faces, problem_.chart.n_vertices);
  const Points2 start = angles_;
  const SurfaceMeasures before = measures();
  const auto within = [&](const SurfaceMeasures& now, double slack) {
    return now.face_std <= slack * std::max(before.face_std, face_std) &&
           now.face_error <= slack * std::max(before.face_error, face_error);
  };
  const auto good = [&](const SurfaceMeasures& now) {
    return now.flips <= before.flips && within(now, 1.0);
  };
  SurfaceMeasures now = before;
  const auto take = [&](RingStep kind) {
    if (poll) poll();
    const Points2 direction = without_rotation(
        rings_->step(problem_, weights, best_scale(problem_, angles_), angles_, kind, poll));
    angles_ += longest_step(direction) * direction;
    now = measures();
  };
  try {
    int best = 0;
    Points2 after_best = start;
    RingStep kind = least_best > 0 ? RingStep::kBest : RingStep::kStiff;
    for (int step = 0; step < kRingSteps && now.ring_std > kRingGoal; ++step) {
      const double sd = now.ring_std;
      take(kind);
      const bool was_best = kind == RingStep::kBest;
      if (was_best) {
        ++best;
        after_best = angles_;
      }
      if (best < least_best) continue;
      // The other steps make rings exact and leave faces as they are.
      if (was_best ? within(now, kSlack) : good(now)) {
        const bool again = !was_best && nearly_exact(sd, now.ring_std);
        kind = again ? RingStep::kAgain : RingStep::kStiff;
      } else if (best < most_best) {
        angles_ = after_best;
        kind = RingStep::kBest;
      } else {
        break;
      }
    }
  } catch (const Error&) {  // singular: nothing to be had
    now.ring_std = std::numeric_limits<double>::infinity();
  } catch (...) {  // interrupted
    angles_ = start;
    throw;
  }
  if (now.ring_std <= kRingGoal && good(now)) {
    rings_.reset();
    return true;
  }
  angles_ = start;
  return false;
}

double SurfaceNewton::facing() const {
  const Vec each = least_facing(problem_, angles_);
  return least_of(static_cast<Index>(each.size()), std::numeric_limits<double>::infinity(),
                  [&](Index f) { return each(f); });
}

std::vector<Index> SurfaceNewton::inward() const {
  const Vec each = least_facing(problem_, angles_);
  std::vector<Index> faces;
  for (Index f = 0; f < each.size(); ++f)
    if (!(each(f) > 0.0)) faces.push_back(f);
  return faces;
}

SurfaceMeasures SurfaceNewton::measures() const {
  Vec areas = glide_areas(problem_, angles_);
  const double total = areas.sum();
  areas /= total;
  SurfaceMeasures measured;
  const Vec& source = problem_.reference.areas;
  measured.energy = (areas.array().square() / source.array()).sum();
  const Points image = glide_image(problem_, angles_);
  const double R = problem_.torus().R;
  measured.flips =
      static_cast<Index>(certificate::torus_graph(image, problem_.chart.faces, R).bad.size());
  measured.angle_mean = mean_angle_distortion(problem_.reference, problem_.chart.faces, image);
  ratio_measures(problem_.chart.faces, problem_.chart.n_vertices, source, areas, measured);
  return measured;
}

}  // namespace stretchmap::area
