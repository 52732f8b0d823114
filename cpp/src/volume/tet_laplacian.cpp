#include "stretchmap/volume/tet_laplacian.hpp"

#include <algorithm>
#include <array>

#include "stretchmap/base/parallel.hpp"
#include "volume/tet_weights.hpp"

namespace stretchmap::volume {
namespace {

using Row3 = Eigen::RowVector3d;

// Outward area vectors (length = area of the face opposite the vertex) of a positive tet.
struct AreaVectors {
  std::array<Row3, 4> g;
  double volume;
};

AreaVectors area_vectors(const PointsRef& x, const TetsRef& tets, Index t) {
  const Row3 a = x.row(tets(t, 0));
  const Row3 b = x.row(tets(t, 1)) - a, c = x.row(tets(t, 2)) - a, d = x.row(tets(t, 3)) - a;
  AreaVectors r;
  const Row3 cd = c.cross(d);
  r.g[1] = -0.5 * cd;
  r.g[2] = -0.5 * d.cross(b);
  r.g[3] = -0.5 * b.cross(c);
  r.g[0] = -(r.g[1] + r.g[2] + r.g[3]);
  r.volume = b.dot(cd) / 6.0;
  return r;
}

}  // namespace

TetLaplacian::TetLaplacian(const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest,
                           int lanes)
    : plan_(make_tet_plan(tets, fixed, rest)),
      lanes_(lanes),
      x_(4 * plan_.order.size(), 0.0),
      sums_(plan_.chunk_slot.back()) {}

SparseMatrix TetLaplacian::pattern() const {
  SparseMatrix matrix(plan_.rows(), plan_.rows());
  matrix.resizeNonZeros(plan_.outer.back());
  std::copy(plan_.outer.begin(), plan_.outer.end(), matrix.outerIndexPtr());
  std::copy(plan_.inner.begin(), plan_.inner.end(), matrix.innerIndexPtr());
  return matrix;
}

void TetLaplacian::assemble(const PointsRef& geometry, double c, const PointsRef& x,
                            SparseMatrix& matrix, Points& rhs) {
  const auto n = static_cast<Index>(plan_.order.size());
  for_rows(n, [&](Index i) {
    for (int k = 0; k < 3; ++k)
      x_[4 * static_cast<std::size_t>(i) + k] = geometry(plan_.order[i], k);
  });
  const TetWeightsKernel add_weights = tet_weights_kernel(lanes_);
  for_tasks(plan_.chunks(), [&](Index chunk) {
    std::fill(sums_.begin() + plan_.chunk_slot[chunk], sums_.begin() + plan_.chunk_slot[chunk + 1],
              0.0);
    const auto first = static_cast<std::size_t>(plan_.chunk_tet[chunk]);
    add_weights({x_.data(), plan_.corners.data() + 4 * first, plan_.rest.data() + first,
                 plan_.slots.data() + 6 * first,
                 plan_.chunk_tet[chunk + 1] - plan_.chunk_tet[chunk], c, sums_.data()});
  });
  copy_rows(x, matrix, rhs);
}

// Every off-diagonal entry takes the sum of its edge; rows add up to zero.
void TetLaplacian::copy_rows(const PointsRef& x, SparseMatrix& matrix, Points& rhs) const {
  const Index rows = plan_.rows();
  double* value = matrix.valuePtr();
  rhs.resize(rows, 3);
  for_rows(rows, [&](Index r) {
    double total = 0.0;
    Index p = plan_.outer[r];
    for (Index e = plan_.lower_start[r]; e < plan_.lower_start[r + 1]; ++e)
      total += value[p++] = sums_[plan_.lower_slot[e]];
    const Index diagonal = p++;
    const double* sum = sums_.data() + plan_.row_slot[r];
    while (p < plan_.outer[r + 1]) total += value[p++] = *sum++;
    Row3 b = Row3::Zero();
    for (Index e = plan_.couple_start[r]; e < plan_.couple_start[r + 1]; ++e) {
      total += *sum;
      b -= *sum++ * x.row(plan_.couple_vertex[e]);
    }
    value[diagonal] = -total;
    rhs.row(r) = b;
  });
}

double tet_stretch_energy(const VecRef& image_volumes, const VecRef& rest_volumes) {
  return 1.5 * sum_chunks<1>(static_cast<Index>(rest_volumes.size()),
                             [&](Index begin, Index end, std::array<double, 1>& sum) {
                               const Index size = end - begin;
                               sum[0] += (image_volumes.segment(begin, size).array().square() /
                                          rest_volumes.segment(begin, size).array())
                                             .sum();
                             })[0];
}

Points tet_stretch_gradient(const PointsRef& image, const TetsRef& tets,
                            const VecRef& rest_volumes) {
  Points gradient = Points::Zero(image.rows(), 3);
  for (Index t = 0; t < tets.rows(); ++t) {
    const AreaVectors a = area_vectors(image, tets, t);
    // d|f| / df_i = -g_i / 3
    const double factor = -a.volume / rest_volumes[t];
    for (int i = 0; i < 4; ++i) gradient.row(tets(t, i)) += factor * a.g[i];
  }
  return gradient;
}

}  // namespace stretchmap::volume
