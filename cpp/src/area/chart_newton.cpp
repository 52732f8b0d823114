#include "stretchmap/area/chart_newton.hpp"

#include <cmath>
#include <limits>

#include "stretchmap/area/line_roots.hpp"

namespace stretchmap::area {

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Matrix4 = Eigen::Matrix4d;

double value_of(const Matrix2d& K, double area, double shape) {
  const double D = K.determinant();
  if (!(D > 0.0)) return std::numeric_limits<double>::infinity();
  return shape * (0.5 * K.squaredNorm() / D - 1.0) + area * (D + 1.0 / D - 2.0);
}

void linearise(const Matrix2d& K, double area, double shape, Matrix2d& P, Matrix4& H) {
  const double D = K.determinant(), I = K.squaredNorm();
  const double a = 0.5 * shape / D, a1 = -a / D, a2 = -2.0 * a1 / D;
  const double slope = a1 * I + area * (1.0 - 1.0 / (D * D));
  const double curvature = a2 * I + area * 2.0 / (D * D * D);
  Matrix2d cof;
  cof << K(1, 1), -K(1, 0), -K(0, 1), K(0, 0);
  P = 2.0 * a * K + slope * cof;
  const double e = 0.5 * (K(0, 0) + K(1, 1)), f = 0.5 * (K(0, 0) - K(1, 1));
  const double g = 0.5 * (K(1, 0) + K(0, 1)), h = 0.5 * (K(1, 0) - K(0, 1));
  const double q = std::hypot(e, h), r = std::hypot(f, g);
  const double sum = std::atan2(h, e), difference = std::atan2(g, f);
  const Matrix2d U = Eigen::Rotation2Dd(0.5 * (sum + difference)).toRotationMatrix();
  const Matrix2d V = Eigen::Rotation2Dd(0.5 * (difference - sum)).toRotationMatrix();
  const Vector2d s(q + r, q - r), d(s[1], s[0]);
  Matrix2d A;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      A(i, j) = 2.0 * a1 * (s[i] * d[j] + s[j] * d[i]) + curvature * d[i] * d[j] +
                (i == j ? 2.0 * a : slope);
  H.setZero();
  const auto add = [&](double eigenvalue, const Matrix2d& core) {
    if (eigenvalue <= 0.0) return;
    const Matrix2d mode = U * core * V.transpose();
    const Eigen::Map<const Eigen::Vector4d> m(mode.data());
    H.noalias() += (eigenvalue * m) * m.transpose();
  };
  Eigen::SelfAdjointEigenSolver<Matrix2d> eigen;
  eigen.computeDirect(A);
  for (int k = 0; k < 2; ++k)
    add(eigen.eigenvalues()[k], Matrix2d(eigen.eigenvectors().col(k).asDiagonal()));
  Matrix2d twist, flip;
  twist << 0.0, 1.0, -1.0, 0.0;
  flip << 0.0, 1.0, 1.0, 0.0;
  add(2.0 * a + slope, std::sqrt(0.5) * twist);
  add(2.0 * a - slope, std::sqrt(0.5) * flip);
}

}  // namespace

ChartNewton::ChartNewton(SurfaceChart chart, SurfaceReference reference, double aspect,
                         Points2 turns)
    : chart_(std::move(chart)),
      reference_(std::move(reference)),
      periods_(std::sqrt(aspect), 1.0 / std::sqrt(aspect)),
      turns_(std::move(turns)),
      rest_(reference_.areas.size(), 4),
      pattern_(chart_.faces, chart_.n_vertices, 2) {
  for (Index f = 0; f < rest_.rows(); ++f) {
    const double twice = 2.0 * reference_.areas(f);
    const double base = std::sqrt(twice * (reference_.cotan(f, 0) + reference_.cotan(f, 1)));
    const double height = twice / base;
    Matrix2d edges;
    edges << base, height * reference_.cotan(f, 0), 0.0, height;
    const Matrix2d inverse = edges.inverse();
    rest_.row(f) << inverse(0, 0), inverse(0, 1), inverse(1, 0), inverse(1, 1);
  }
}

Matrix2d ChartNewton::jacobian(const Points2& turns, Index f, double tau) const {
  const Vector2d origin = chart_.corner(turns, f, 0);
  Matrix2d edges, rest;
  edges << chart_.corner(turns, f, 1) - origin, chart_.corner(turns, f, 2) - origin;
  rest << rest_(f, 0), rest_(f, 1), rest_(f, 2), rest_(f, 3);
  return periods_.asDiagonal() * edges * rest / std::sqrt(tau);
}

double ChartNewton::energy(const Points2& turns, const Vec& tau, double area, double shape) const {
  Vec values(tau.size());
#pragma omp parallel for schedule(static)
  for (Index f = 0; f < static_cast<Index>(tau.size()); ++f)
    values(f) = weights_(f) * value_of(jacobian(turns, f, tau(f)), area, shape);
  return values.sum();
}

ChartStep ChartNewton::step(double area, double shape, double reach, int mix, const Poll& poll) {
  const Index m = static_cast<Index>(reference_.areas.size());
  const Vec ratio = turn_areas(chart_, turns_).cwiseQuotient(reference_.areas);
  const Vec tau = ratio.array().cwiseInverse().max(1.0 / reach).min(reach) * ratio.array();
  const Vec image = ratio.cwiseProduct(reference_.areas);
  if (mix == 0) weights_ = reference_.areas;
  else if (mix == 1) weights_ = (image + reference_.areas) / 2;
  else if (mix == 2) weights_ = image.cwiseProduct(reference_.areas).cwiseSqrt();
  else if (mix == 3) weights_ = image.cwiseMax(reference_.areas);
  else if (mix == 4) weights_ = Vec::Constant(m, 1.0 / m);
  else weights_ = image;
  ChartStep result;
  for (Index f = 0; f < m; ++f)
    if (std::abs(tau(f) - 1.0) < 1e-9) result.reached += reference_.areas(f);
  Rows hessians(m, 36), gradients(m, 6);
  Vec values(m);
#pragma omp parallel for schedule(static)
  for (Index f = 0; f < m; ++f) {
    const Matrix2d K = jacobian(turns_, f, tau(f));
    Matrix2d P;
    Matrix4 H;
    linearise(K, area, shape, P, H);
    const double w = weights_(f);
    values(f) = w * value_of(K, area, shape);
    // vec K = B x: K(i, j) = periods_i sum_k G(k, j) x_k(i)
    Matrix2d rest;
    rest << rest_(f, 0), rest_(f, 1), rest_(f, 2), rest_(f, 3);
    rest /= std::sqrt(tau(f));
    Eigen::Matrix<double, 3, 2> G;
    G.bottomRows<2>() = rest;
    G.row(0) = -(rest.row(0) + rest.row(1));
    Eigen::Matrix<double, 4, 6> B = Eigen::Matrix<double, 4, 6>::Zero();
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) B(i + 2 * j, 2 * k + i) = periods_(i) * G(k, j);
    const Eigen::Map<const Eigen::Vector4d> p(P.data());
    gradients.row(f) = w * (B.transpose() * p).transpose();
    Eigen::Map<Eigen::Matrix<double, 6, 6>>(hessians.row(f).data()) = w * B.transpose() * H * B;
  }
  Vec gradient = Vec::Zero(turns_.size());
  for (Index f = 0; f < m; ++f)
    for (int k = 0; k < 3; ++k)
      gradient.segment<2>(2 * chart_.faces(f, k)) +=
          gradients.row(f).segment<2>(2 * k).transpose();
  SparseMatrix matrix = pattern_.zeros();
  pattern_.scatter(hessians, matrix.valuePtr());
  const double ridge = 1e-12 * Vec(matrix.diagonal()).mean();
  for (Index i = 0; i < matrix.rows(); ++i) matrix.coeffRef(i, i) += ridge;
  if (!solver_) solver_.emplace(matrix);
  solver_->factorise(matrix, poll);
  const Vec flat = solver_->solve(-gradient);
  Points2 direction = Eigen::Map<const Points2>(flat.data(), flat.size() / 2, 2);
  direction.rowwise() -= direction.colwise().mean();
  const double slope = gradient.dot(flat);
  result.before = result.after = values.sum();
  result.decrement = -slope;
  double t = longest_step(direction);
  for (int halving = 0; halving < 30; ++halving, t *= 0.5) {
    const Points2 trial = turns_ + t * direction;
    const double value = energy(trial, tau, area, shape);
    if (!(value <= result.before + 1e-4 * t * slope)) continue;
    turns_ = trial;
    result.after = value;
    result.step = t;
    break;
  }
  return result;
}

double ChartNewton::longest_step(const Points2& direction) const {
  SurfaceChart loops = chart_;
  loops.shift_u.setZero();
  loops.shift_v.setZero();
  const Vec now = turn_areas(chart_, turns_);
  const Vec quadratic = turn_areas(loops, direction);
  const Vec linear = turn_areas(chart_, turns_ + direction) - now - quadratic;
  double longest = 1.0;
  for (Index f = 0; f < now.size(); ++f)
    if (now(f) > 0.0) longest = std::min(longest, 0.9 * first_root(now(f), linear(f), quadratic(f)));
  return longest;
}

SurfaceFigures ChartNewton::figures() const {
  const Vec image = turn_areas(chart_, turns_);
  SurfaceFigures figures;
  figures.energy = image.array().square().cwiseQuotient(reference_.areas.array()).sum();
  figures.flips = static_cast<Index>((image.array() <= 0.0).count());
  ratio_figures(chart_.faces, chart_.n_vertices, reference_.areas, image, figures);
  return figures;
}

}  // namespace stretchmap::area
