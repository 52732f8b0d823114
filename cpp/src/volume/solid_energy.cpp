#include "stretchmap/volume/solid_energy.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::volume {
namespace {

using Eigen::Matrix3d;
using Eigen::RowVector3d;
using Eigen::Vector3d;
using Block = Eigen::Map<Block3>;

// Sum in blocks of fixed size: the result does not depend on the number of threads.
double blocked_sum(const Vec& values) {
  constexpr Index kBlock = 4096;
  const Index n = static_cast<Index>(values.size());
  std::vector<double> sums(chunk_count(n, kBlock));
  for_chunks(n, kBlock, [&](Index begin, Index end) {
    sums[begin / kBlock] = values.segment(begin, end - begin).sum();
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

// to += block, two numbers at a time.
void add_block(const Block3& block, double* to) {
  using Eight = Eigen::Array<double, 8, 1>;
  Eigen::Map<Eight> head(to);
  head += Eigen::Map<const Eight>(block.data());
  to[8] += block(2, 2);
}

}  // namespace

template <class Item, class Visit>
void SolidEnergy::for_batches(const PointsRef& x, const EnergyWeights& w, Index first, Index last,
                              void (*evaluate)(ElementBatch&, const EnergyWeights&),
                              const Item& item, const Visit& visit) const {
  ElementBatch batch;
  const bool soft = own_.size() > 0;
  for (Index begin = first; begin < last; begin += kLanes) {
    for (int l = 0; l < kLanes; ++l) {
      const Index t = item(std::min(begin + l, last - 1));
      const double* origin = x.data() + 3 * static_cast<std::ptrdiff_t>(tets_(t, 0));
      for (int a = 0; a < 3; ++a) {
        const double* corner = x.data() + 3 * static_cast<std::ptrdiff_t>(tets_(t, a + 1));
        for (int i = 0; i < 3; ++i) batch.edges[3 * a + i][l] = corner[i] - origin[i];
      }
      for (int k = 0; k < 9; ++k) batch.rest[k][l] = rest_(t, k);
      batch.weight[l] = weights_[t];
      if (soft) batch.own[l] = own_[t];
    }
    evaluate(batch, w);
    for (int l = 0; l < kLanes && begin + l < last; ++l) visit(item(begin + l), l, batch);
  }
}

void SolidEnergy::set_targets(const VecRef& target) {
  const Index k = static_cast<Index>(tets_.rows());
  if (target_.size() == 0) target_.setOnes(k);
  for_rows(k, [&](Index t) {
    const double wanted = target[order_[t]];
    rest_.row(t) *= std::cbrt(target_[t] / wanted);
    target_[t] = wanted;
  });
}

void SolidEnergy::soften(const PointsRef& x, double share) {
  own_.resize(0);
  if (!(share > 0.0)) return;
  const Index k = static_cast<Index>(tets_.rows());
  Vec own(k);
  for_chunks(k, kElementChunk, [&](Index begin, Index end) {
    for_batches(
        x, {1.0, 1.0, 1.0}, begin, end, element_values, [](Index t) { return t; },
        [&](Index t, int lane, const ElementBatch& batch) {
          const double inverted = share * std::min(batch.det[lane], 0.0);
          own[t] = inverted * inverted;
        });
  });
  own_ = std::move(own);
}

SolidEnergy::Energies SolidEnergy::energies(const PointsRef& x, const EnergyWeights& w) const {
  const Index k = static_cast<Index>(tets_.rows());
  Energies found;
  found.tets.resize(k);
  found.det.resize(k);
  for_chunks(k, kElementChunk, [&](Index begin, Index end) {
    for_batches(
        x, w, begin, end, element_values, [](Index t) { return t; },
        [&](Index t, int lane, const ElementBatch& batch) {
          found.det[t] = batch.det[lane];
          found.tets[t] = batch.energy[lane];
        });
  });
  if (!(w.face > 0.0) || barrier_.size() == 0) return found;
  found.faces.resize(barrier_.size());
  found.facing.resize(barrier_.size());
  const GlideSites at = sites(x, false);
  for_rows(barrier_.size(), kElementChunk, [&](Index f) {
    const FaceReport there = barrier_.value(x, at, f, w.epsilon);
    found.faces[f] = w.face * there.energy;
    found.facing[f] = there.facing;
  });
  return found;
}

EnergyReport SolidEnergy::value(const PointsRef& x, const EnergyWeights& w) const {
  return summed(energies(x, w));
}

EnergyReport SolidEnergy::summed(const Energies& found) {
  EnergyReport report;
  report.energy = blocked_sum(found.tets);
  if (found.faces.size() > 0) {
    report.energy += blocked_sum(found.faces);
    report.min_facing = found.facing.minCoeff();
    report.folds = static_cast<Index>((found.facing.array() <= 0.0).count());
  }
  const Index k = static_cast<Index>(found.det.size());
  if (k == 0) return report;
  report.min_det = least_of(k, found.det[0], [&](Index t) { return found.det[t]; });
  if (!(report.min_det > 0.0))
    report.flips = static_cast<Index>((found.det.array() <= 0.0).count());
  return report;
}

// Adds the tet's share to the rows in [first, last).
void SolidEnergy::add_element(const ElementBatch& batch, int lane, Index t, Index first, Index last,
                              Points& gradient, linalg::BlockMatrix* hessian) const {
  std::array<Index, 4> row;
  std::array<bool, 4> mine;
  for (int a = 0; a < 4; ++a) {
    row[a] = vertex_row_[tets_(t, a)];
    mine[a] = row[a] >= first && row[a] < last;
  }
  RowVector3d others = RowVector3d::Zero();
  for (int a = 0; a < 3; ++a) {
    const RowVector3d g(batch.gradient[3 * a][lane], batch.gradient[3 * a + 1][lane],
                        batch.gradient[3 * a + 2][lane]);
    others += g;
    if (mine[a + 1]) gradient.row(row[a + 1]) += g;
  }
  if (mine[0]) gradient.row(row[0]) -= others;
  if (!hessian) return;

  double* blocks = hessian->values.data();
  Block3 H[4][4];
  tet_blocks(batch, lane, 1.0, H);
  for (int a = 0; a < 4; ++a) {
    if (!mine[a]) continue;
    for (int b = 0; b < 4; ++b) {
      if (row[b] < 0) continue;
      const std::uint8_t place = place_(t, 4 * a + b);
      const Index slot =
          place < kFar ? row_ptr_[row[a]] + place : find_block(hessian->col, row[a], row[b]);
      add_block(H[a][b], blocks + 9 * static_cast<std::ptrdiff_t>(slot));
    }
  }
}

void SolidEnergy::model(const PointsRef& x, const EnergyWeights& w, Points& gradient,
                        linalg::BlockMatrix* hessian) const {
  gradient.setZero(rows(), 3);
  double* blocks = hessian ? hessian->values.data() : nullptr;
  const Index parts = static_cast<Index>(part_tets_.size());
  for_tasks(parts, [&](Index p) {
    const std::vector<Index>& list = part_tets_[p];
    if (blocks)
      std::fill(blocks + 9 * static_cast<std::ptrdiff_t>(row_ptr_[part_row_[p]]),
                blocks + 9 * static_cast<std::ptrdiff_t>(row_ptr_[part_row_[p + 1]]), 0.0);
    for_batches(
        x, w, 0, static_cast<Index>(list.size()), blocks ? element_models : element_gradients,
        [&](Index position) { return list[position]; },
        [&](Index t, int lane, const ElementBatch& batch) {
          add_element(batch, lane, t, part_row_[p], part_row_[p + 1], gradient, hessian);
        });
  });
  if ((motion_.array() != kGliding).all()) return;
  const Index n_rows = rows();
  const GlideSites at = sites(x, true);
  for_rows(n_rows, kElementChunk,
           [&](Index row) { into_frames(x, at, w.negative, row, gradient, hessian); });
  if (w.face <= 0.0) return;
  for_tasks(parts, [&](Index p) {
    for (const Index f : part_faces_[p])
      add_face(x, at, w, f, part_row_[p], part_row_[p + 1], gradient, hessian);
  });
}

// Adds the boundary triangle's share to the rows in [first, last), which are in frames already.
void SolidEnergy::add_face(const PointsRef& x, const GlideSites& sites, const EnergyWeights& w,
                           Index f, Index first, Index last, Points& gradient,
                           linalg::BlockMatrix* hessian) const {
  Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  barrier_.model(x, sites, f, w.epsilon, g, hessian ? &H : nullptr);
  for (int a = 0; a < 3; ++a) {
    const Index row = vertex_row_[barrier_.faces()(f, a)];
    if (row < first || row >= last) continue;
    gradient.row(row).head<2>() += w.face * g.segment<2>(2 * a).transpose();
    for (int b = 0; hessian && b < 3; ++b)
      if (const Index slot = face_slot_(f, 3 * a + b); slot >= 0)
        Block(hessian->values.data() + 9 * static_cast<std::ptrdiff_t>(slot))
            .topLeftCorner<2, 2>() += w.face * H.block<2, 2>(2 * a, 2 * b);
  }
}

GlideSites SolidEnergy::sites(const PointsRef& x, bool derivatives) const {
  if (site_vertex_.empty()) return {site_number_, {}};
  return sites_at(barrier_.surface(), x, site_vertex_, site_number_, derivatives, site_place_);
}

// Axes of a vertex: Cartesian, or those of the surface it glides on.
Matrix3d SolidEnergy::frame(const GlideSites& sites, Index vertex) const {
  return motion_[vertex] == kGliding ? sites(vertex).frame : Matrix3d::Identity();
}

// Rewrites one block row in vertex frames and, for a gliding vertex, adds the surface's own second
// derivatives (of negative eigenvalues a share) and removes the normal unknown.
void SolidEnergy::into_frames(const PointsRef& x, const GlideSites& sites, double negative,
                              Index row, Points& gradient, linalg::BlockMatrix* hessian) const {
  const Index vertex = row_vertex_[row];
  const Matrix3d Q = frame(sites, vertex);
  const bool gliding = motion_[vertex] == kGliding;
  const Vector3d g = Q.transpose() * gradient.row(row).transpose();
  for (Index p = row_ptr_[row]; hessian && p < row_ptr_[row + 1]; ++p) {
    const Index other = row_vertex_[hessian->col[p]];
    if (!gliding && motion_[other] != kGliding) continue;
    Block block(hessian->values.data() + 9 * static_cast<std::ptrdiff_t>(p));
    Matrix3d turned = Q.transpose() * block * frame(sites, other);
    if (gliding) turned.row(2).setZero();
    if (motion_[other] == kGliding) turned.col(2).setZero();
    if (gliding && other == vertex) {
      const Eigen::Matrix2d C =
          barrier_.surface().bending(x.row(vertex).transpose(), sites(vertex), g);
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
      eigen.computeDirect(C);
      const Eigen::Vector2d values = eigen.eigenvalues().cwiseMax(negative * eigen.eigenvalues());
      turned.topLeftCorner<2, 2>() +=
          eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
      turned(2, 2) = 1.0;
    }
    block = turned;
  }
  gradient.row(row) = g.transpose();
  if (gliding) gradient(row, 2) = 0.0;
}

}  // namespace stretchmap::volume
