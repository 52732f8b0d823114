#include "stretchmap/area/surface_rings.hpp"

#include <cmath>
#include <vector>

#include "area/face_jet.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/parallel.hpp"

namespace stretchmap::area {

namespace {

// A little give in the ring equations makes the system quasi-definite, and then it has a
// factorization in any order. The solution is refined against the equations without it.
constexpr double kGive = 1e-9;
constexpr double kRingRidge = 1e-10;  // holds the rotation about the axis
constexpr int kRefinements = 3;
constexpr double kAccuracy = 1e-5;

struct Rings {
  Vec source, image;  // (n) areas of the rings
  Rows gradients;     // (m, 6) of the face areas
  double total = 0.0;
};

Rings measure(const GlideProblem& problem, const Points2Ref& angles) {
  const Faces& faces = problem.chart.faces;
  const Index n = problem.chart.n_vertices;
  const std::vector<TorusPoint> points = torus_points(problem.torus(), angles);
  Rings rings{Vec::Zero(n), Vec::Zero(n), Rows(faces.rows(), 6), 0.0};
  Vec areas(faces.rows());
  for_rows(static_cast<Index>(faces.rows()), kElementChunk, [&](Index f) {
    TorusPoint p[3];
    for (int k = 0; k < 3; ++k) p[k] = points[faces(f, k)];
    const Jet area = area_jet(p, false);
    rings.gradients.row(f) = area.gradient;
    areas(f) = area.value;
  });
  for (Index f = 0; f < faces.rows(); ++f) {
    rings.total += areas(f);
    for (int k = 0; k < 3; ++k) {
      rings.source(faces(f, k)) += problem.reference.areas(f);
      rings.image(faces(f, k)) += areas(f);
    }
  }
  return rings;
}

// Faces' parts of the system, rows and columns ordered (u, v, multiplier) corner by corner.
Rows elements(const GlideProblem& problem, const Rings& rings, const Rows& hessians) {
  using NineNine = Eigen::Matrix<double, 9, 9>;
  Rows blocks(hessians.rows(), 81);
  for_rows(static_cast<Index>(hessians.rows()), kElementChunk, [&](Index f) {
    const Eigen::Map<const Eigen::Matrix<double, 6, 6>> hessian(hessians.row(f).data());
    NineNine block = NineNine::Zero();
    for (int j = 0; j < 3; ++j) {
      const double weight = 1.0 / (rings.total * rings.source(problem.chart.faces(f, j)));
      for (int k = 0; k < 3; ++k) {
        block.block<2, 2>(3 * j, 3 * k) = hessian.block<2, 2>(2 * j, 2 * k);
        const Eigen::RowVector2d row = weight * rings.gradients.row(f).segment<2>(2 * k);
        block.block<1, 2>(3 * j + 2, 3 * k) = row;
        block.block<2, 1>(3 * k, 3 * j + 2) = row.transpose();
      }
    }
    Eigen::Map<NineNine>(blocks.row(f).data()) = block;
  });
  return blocks;
}

Vec product(const SparseMatrix& matrix, const Vec& x) {
  Vec result(matrix.rows());
  for_rows(static_cast<Index>(matrix.rows()), kElementChunk, [&](Index i) {
    double sum = 0.0;
    for (SparseMatrix::InnerIterator it(matrix, i); it; ++it) sum += it.value() * x(it.col());
    result(i) = sum;
  });
  return result;
}

Vec give_of(const SparseMatrix& matrix, const Vec& diagonal) {
  const Index n = static_cast<Index>(matrix.rows()) / 3;
  const double size = diagonal.sum() / (2.0 * n);
  Vec couplings(n);
  for_rows(n, kElementChunk,
           [&](Index i) { couplings(i) = matrix.row(3 * i + 2).squaredNorm() / n; });
  double coupling = 0.0;
  for (const double one : couplings) coupling += one;
  Vec give(3 * n);
  for (Index i = 0; i < 3 * n; ++i)
    give(i) = i % 3 == 2 ? -kGive * coupling / size : kRingRidge * size;
  return give;
}

void set_diagonal(SparseMatrix& matrix, const Vec& diagonal) {
  for_rows(static_cast<Index>(matrix.rows()),
           [&](Index i) { matrix.coeffRef(i, i) = diagonal(i); });
}

}  // namespace

Points2 RingSystem::step(const GlideProblem& problem, const SurfaceWeights& weights, double scale,
                         const Points2Ref& angles, RingStep kind, const Poll& poll) {
  const Index n = problem.chart.n_vertices;
  const Rings rings = measure(problem, angles);
  Vec right = Vec::Zero(3 * n);
  for (Index i = 0; i < n; ++i)
    right(3 * i + 2) = 1.0 - rings.image(i) / (rings.total * rings.source(i));
  SparseMatrix& exact = pattern_.matrix();
  if (kind != RingStep::kAgain) {
    SurfaceWeights model = weights;
    if (kind == RingStep::kStiff) model.area = 0.0;
    if (factor_) factor_->let_go();
    {  // what the matrix is made of is as large as its factor
      GlideEnergy energy = glide_energy(problem, model, scale, angles, Derivatives::kModel);
      for (Index i = 0; i < n && kind == RingStep::kBest; ++i)
        right.segment<2>(3 * i) = -energy.gradient.segment<2>(2 * i);
      pattern_.scatter(elements(problem, rings, energy.hessians), exact.valuePtr());
    }
    const Vec diagonal = exact.diagonal();
    set_diagonal(exact, diagonal + give_of(exact, diagonal));
    if (!factor_) factor_.emplace(exact);
    factor_->factorize(exact, poll);
    set_diagonal(exact, diagonal);
  }
  Vec solution = factor_->solve(right);
  for (int i = 0; i < kRefinements; ++i) {
    const Vec residual = right - product(exact, solution);
    if (residual.norm() <= kAccuracy * right.norm()) break;
    solution += factor_->solve(residual);
  }
  Points2 change(n, 2);
  for (Index i = 0; i < n; ++i) change.row(i) = solution.segment<2>(3 * i).transpose();
  return change;
}

}  // namespace stretchmap::area
