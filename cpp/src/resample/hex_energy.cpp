#include "stretchmap/resample/hex_energy.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/parallel.hpp"
#include "stretchmap/linalg/pattern.hpp"

namespace stretchmap::resample {
namespace {

using Eigen::RowVector3d;
using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Block = Eigen::Map<RowMatrix3d>;
using volume::ElementBatch;

}  // namespace

double FitNorm::value(double d) const {
  return tolerance * tolerance * (std::pow(base(d), power) - 1.0) / power;
}

double FitNorm::slope(double d) const { return 2.0 * d * std::pow(base(d), power - 1.0); }

double FitNorm::curvature(double d) const {
  const double b = base(d);
  return 2.0 * std::pow(b, power - 1.0) * (1.0 + 2.0 * (power - 1.0) * (b - 1.0) / b);
}

HexEnergy::HexEnergy(const HexesRef& hexes, Index n) : n_(n), hexes_(hexes) {
  const Index k = static_cast<Index>(hexes_.rows());
  const Incidence<> corners = corners_at(hexes_, n);
  const linalg::Pattern pattern = linalg::build_pattern(n, n, [&](Index i, linalg::RowSet& row) {
    for (const Index corner : corners[i])
      for (int b = 0; b < 8; ++b) row.add(hexes_(corner / 8, b));
  });
  row_ptr_ = Eigen::Map<const IndexVec>(pattern.start.data(), n + 1);
  col_ = Eigen::Map<const IndexVec>(pattern.col.data(), row_ptr_[n]);
  slot_.setConstant(k, 64, -1);
  for_chunks(k, [&](Index begin, Index end) {
    for (Index h = begin; h < end; ++h)
      for (int a = 0; a < 8; ++a)
        for (int b = 0; b < 8; ++b) slot_(h, 8 * a + b) = find_block(hexes_(h, a), hexes_(h, b));
  });
  part_hexes_.resize(chunk_count(n));
  for_chunks(n, [&](Index begin, Index end) {
    std::vector<Index>& list = part_hexes_[begin / kChunk];
    for (const Index corner : corners.of(begin, end)) list.push_back(corner / 8);
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  });
}

void HexEnergy::set_rest(const Eigen::Ref<const Rows24>& sides, const VecRef& weights,
                         Flags guarded) {
  inverse_ = sides.array().inverse();
  weights_ = weights / 8.0;
  guarded_ = std::move(guarded);
}

void HexEnergy::set_fit(FitSamples samples, const VecRef& factor, const FitNorm& norm) {
  fit_ = std::move(samples);
  factor_ = factor;
  norm_ = norm;
}

linalg::BlockMatrix HexEnergy::pattern() const {
  linalg::BlockMatrix out;
  out.row_ptr = row_ptr_;
  out.col = col_;
  out.values.setZero(9 * static_cast<Eigen::Index>(col_.size()));
  return out;
}

Index HexEnergy::find_block(Index row, Index column) const {
  const Index* first = col_.data() + row_ptr_[row];
  return static_cast<Index>(std::lower_bound(first, col_.data() + row_ptr_[row + 1], column) -
                            col_.data());
}

void HexEnergy::load(const PointsRef& x, Index h, int part, ElementBatch& batch) const {
  static_assert(volume::kLanes == 8, "eight triples a batch");
  for (int c = 0; c < 8; ++c) {
    const EdgeTriple& triple = edge_triples()[8 * part + c];
    const double* origin = x.data() + 3 * static_cast<std::ptrdiff_t>(hexes_(h, triple.corner[0]));
    for (int a = 0; a < 3; ++a) {
      const double* end =
          x.data() + 3 * static_cast<std::ptrdiff_t>(hexes_(h, triple.corner[a + 1]));
      for (int i = 0; i < 3; ++i) batch.edges[3 * a + i][c] = end[i] - origin[i];
      for (int b = 0; b < 3; ++b) batch.rest[3 * a + b][c] = 0.0;
      batch.rest[3 * a + a][c] = inverse_(h, triple.side[a]);
    }
    if (triple.far > 0) batch.rest[triple.far][c] = -inverse_(h, triple.side[triple.far]);
    batch.weight[c] = 1.0;
  }
}

// From the tangent plane of sample j, moved inwards.
double HexEnergy::gap(const PointsRef& x, Index j) const {
  RowVector3d p = -fit_.point.row(j);
  for (int c = 0; c < 4; ++c) p += fit_.weights(j, c) * x.row(fit_.corners(j, c));
  return p.dot(fit_.normal.row(j)) + norm_.inward;
}

HexReport HexEnergy::value(const PointsRef& x, const HexWeights& w) const {
  const Index k = static_cast<Index>(hexes_.rows());
  Vec least(k);
  IndexVec flips(k);
  const double energy = sum_chunks<1>(k, [&](Index begin, Index end, std::array<double, 1>& sums) {
    ElementBatch batch;
    for (Index h = begin; h < end; ++h) {
      least[h] = std::numeric_limits<double>::infinity();
      flips[h] = 0;
      for (int part = 0; part < batches(h); ++part) {
        load(x, h, part, batch);
        element_values(batch, w.corner);
        least[h] = std::min(least[h], *std::min_element(batch.det, batch.det + 8));
        double sum = 0.0;
        for (int c = 0; c < 8; ++c) {
          sum += (std::pow(1.0 + batch.energy[c], w.power) - 1.0) / w.power;
          flips[h] += !(batch.det[c] > 0.0);
        }
        sums[0] += weight(h, part) * sum;
      }
    }
  })[0];
  const double fit = sum_chunks<1>(static_cast<Index>(factor_.size()),
                                   [&](Index begin, Index end, std::array<double, 1>& sums) {
                                     for (Index j = begin; j < end; ++j) {
                                       sums[0] += factor_[j] * norm_.value(gap(x, j));
                                     }
                                   })[0];
  return {energy + fit, fit, k > 0 ? least.minCoeff() : 0.0, flips.sum()};
}

// Adds the share of a hexahedron to the rows in [first, last).
void HexEnergy::add(const ElementBatch& batch, double power, Index h, int part, Index first,
                    Index last, Points& gradient, double* blocks) const {
  for (int c = 0; c < 8; ++c) {
    const double base = 1.0 + batch.energy[c];
    const double slope = weight(h, part) * std::pow(base, power - 1.0);
    const double curvature = (power - 1.0) / base * slope;
    RowVector3d g[4];
    g[0].setZero();
    for (int a = 0; a < 3; ++a) {
      for (int i = 0; i < 3; ++i) g[a + 1][i] = batch.gradient[3 * a + i][c];
      g[0] -= g[a + 1];
    }
    volume::Block3 H[4][4];
    volume::tet_blocks(batch, c, slope, H);
    const std::array<int, 4>& corners = edge_triples()[8 * part + c].corner;
    for (int a = 0; a < 4; ++a) {
      const int corner = corners[a];
      const Index row = hexes_(h, corner);
      if (row < first || row >= last) continue;
      gradient.row(row) += slope * g[a];
      for (int b = 0; b < 4; ++b) {
        if (curvature > 0.0) H[a][b] += curvature * g[a].transpose() * g[b];
        const Index slot = slot_(h, 8 * corner + corners[b]);
        Block(blocks + 9 * static_cast<std::ptrdiff_t>(slot)) += H[a][b];
      }
    }
  }
}

void HexEnergy::model(const PointsRef& x, const HexWeights& w, Points& gradient,
                      linalg::BlockMatrix& hessian) const {
  gradient.setZero(n_, 3);
  hessian.values.setZero();
  double* blocks = hessian.values.data();
  for_chunks(n_, [&](Index begin, Index end) {
    ElementBatch batch;
    for (const Index h : part_hexes_[begin / kChunk]) {
      for (int part = 0; part < batches(h); ++part) {
        load(x, h, part, batch);
        element_models(batch, w.corner);
        add(batch, w.power, h, part, begin, end, gradient, blocks);
      }
    }
  });
  add_fit(x, gradient, blocks);
}

void HexEnergy::add_fit(const PointsRef& x, Points& gradient, double* blocks) const {
  for (Index j = 0; j < factor_.size(); ++j) {
    const RowVector3d normal = fit_.normal.row(j);
    const double d = gap(x, j);
    const double slope = factor_[j] * norm_.slope(d);
    const RowMatrix3d plane = factor_[j] * norm_.curvature(d) * normal.transpose() * normal;
    for (int a = 0; a < 4; ++a) {
      const double weight = fit_.weights(j, a);
      if (weight == 0.0) continue;
      const Index row = fit_.corners(j, a);
      gradient.row(row) += slope * weight * normal;
      for (int b = 0; b < 4; ++b) {
        if (fit_.weights(j, b) == 0.0) continue;
        const Index slot = find_block(row, fit_.corners(j, b));
        Block(blocks + 9 * static_cast<std::ptrdiff_t>(slot)) +=
            weight * fit_.weights(j, b) * plane;
      }
    }
  }
}

}  // namespace stretchmap::resample
