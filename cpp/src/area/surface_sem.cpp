#include "stretchmap/area/surface_sem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stretchmap/area/surface_stretch.hpp"

namespace stretchmap::area {

namespace {

constexpr double kRoughly = 1e-3;  // residual that does for a step of the fixed point

// The constant is free: row and column of vertex 0 become the identity.
void pin(SparseMatrix& matrix) {
  for (Index i = 0; i < matrix.outerSize(); ++i)
    for (SparseMatrix::InnerIterator it(matrix, i); it; ++it)
      if (i == 0 || it.col() == 0) it.valueRef() = i == it.col() ? 1.0 : 0.0;
}

// Minimum on (0, longest] of a quartic with coefficients c[0..4] that descends at 0.
double minimize_quartic(const double (&c)[5], double longest) {
  const auto slope = [&](double t) {
    return c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * 4.0 * c[4]));
  };
  double low = 0.0, high = longest;
  if (slope(high) <= 0.0) return high;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (slope(middle) < 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

SurfaceSem::SurfaceSem(SurfaceChart chart, const VecRef& areas, double aspect, Points2 turns)
    : chart_(std::move(chart)),
      areas_(areas / areas.sum()),
      periods_(std::sqrt(aspect), 1.0 / std::sqrt(aspect)),
      turns_(std::move(turns)),
      pattern_(chart_.faces, chart_.n_vertices, 1) {}

SemStep SurfaceSem::step() {
  SparseMatrix matrix = chart_stretch_laplacian(pattern_, chart_, areas_, periods_, turns_);
  pin(matrix);
  if (solver_) {
    std::copy_n(matrix.valuePtr(), matrix.nonZeros(), solver_->matrix().valuePtr());
    solver_->refactor();
  } else {
    solver_.emplace(std::move(matrix));
  }
  const Points2 product = chart_stretch_product(chart_, areas_, periods_, turns_, turns_);
  Rows right = -product;
  right.row(0).setZero();
  Rows direction = Rows::Zero(right.rows(), 2);
  // Whatever comes of it is a direction of descent or not taken.
  linalg::SolveOptions options;
  options.must_converge = false;
  if (solver_->backend() != "direct") options.tol = kRoughly;
  solver_->solve(right, direction, options);
  SemStep result;
  result.residual = 2.0 * (product * periods_.asDiagonal()).norm();
  result.step = line_search(direction);
  turns_ += result.step * direction;
  return result;
}

double SurfaceSem::line_search(const Points2& direction) const {
  const Vec now = turn_areas(chart_, turns_);
  SurfaceChart loops = chart_;
  loops.shift_u.setZero();
  loops.shift_v.setZero();
  const Vec quadratic = turn_areas(loops, direction);
  const Vec linear = turn_areas(chart_, turns_ + direction) - now - quadratic;
  double c[5] = {};
  for (Index f = 0; f < now.size(); ++f) {
    const double w = 1.0 / areas_(f);
    c[1] += 2.0 * w * now(f) * linear(f);
    c[2] += w * (linear(f) * linear(f) + 2.0 * now(f) * quadratic(f));
    c[3] += 2.0 * w * linear(f) * quadratic(f);
    c[4] += w * quadratic(f) * quadratic(f);
  }
  return c[1] < 0.0 ? minimize_quartic(c, unfolded_step(chart_, turns_, direction, 0.95, 2.0))
                    : 0.0;
}

SurfaceMeasures SurfaceSem::measures() const {
  const Vec image = turn_areas(chart_, turns_);
  SurfaceMeasures measured;
  measured.energy = image.array().square().cwiseQuotient(areas_.array()).sum();
  measured.flips = static_cast<Index>((image.array() <= 0.0).count());
  ratio_measures(chart_.faces, chart_.n_vertices, areas_, image, measured);
  return measured;
}

void ratio_measures(const FacesRef& faces, Index n_vertices, const VecRef& source,
                    const VecRef& image, SurfaceMeasures& measured) {
  const auto deviation = [](const Eigen::ArrayXd& ratio) {
    return std::sqrt((ratio - ratio.mean()).square().mean());
  };
  Eigen::ArrayXd from = Eigen::ArrayXd::Zero(n_vertices), to = from;
  for (Index f = 0; f < faces.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      from(faces(f, k)) += source(f);
      to(faces(f, k)) += image(f);
    }
  const Eigen::ArrayXd ratio = image.array() / source.array();
  measured.ring_std = deviation(to / from);
  measured.face_std = deviation(ratio);
  measured.face_error = (ratio - 1.0).abs().maxCoeff();
}

}  // namespace stretchmap::area
