#include "stretchmap/forms/intrinsic_delaunay.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::forms {
namespace {

// Half-edge mesh with lengths; half-edge 3 f + k belongs to face f for ever, what it holds changes.
class Flipper {
 public:
  Flipper(const mesh::SurfaceTopology& top, const VecRef& edge_length,
          const Eigen::Ref<const IndexRows>& eta)
      : slots_(3 * top.faces.rows()),
        halfedge_(top.edge_halfedge.data(), top.edge_halfedge.data() + top.edges.rows()) {
    for (Index h = 0; h < static_cast<Index>(slots_.size()); ++h) {
      const Index e = top.edge[h];
      slots_[h] = {top.tail(h), top.twin[h], e, edge_length[e]};
    }
    eta_.resize(eta.rows(), 3 * top.faces.rows());
    for (Index h = 0; h < eta_.cols(); ++h) {
      eta_.col(h) = eta.col(top.edge[h]) * (top.sign(h) > 0 ? 1 : -1);
    }
  }

  // Half the sum of the two cotangents opposite to edge e.
  double weight(Index e) const {
    const Index h = halfedge_[e];
    return 0.5 * (opposite_cotangent(h) + opposite_cotangent(slots_[h].twin));
  }

  Index run() {
    const Index n = static_cast<Index>(halfedge_.size());
    std::vector<Index> stack(n);
    for (Index e = 0; e < n; ++e) stack[e] = n - 1 - e;
    std::vector<char> waiting(n, 1);
    std::int64_t flips = 0;
    while (!stack.empty()) {
      const Index e = stack.back();
      stack.pop_back();
      waiting[e] = 0;
      if (weight(e) >= -1e-12) continue;
      if (++flips > std::int64_t{100} * n) {
        throw Error("SolverError",
                    "the intrinsic Delaunay triangulation does not settle: the surface has needle "
                    "triangles; remesh it");
      }
      for (const Index h : flip(halfedge_[e])) {
        const Index side = slots_[h].edge;
        if (!waiting[side]) stack.push_back(side);
        waiting[side] = 1;
      }
    }
    return static_cast<Index>(flips);
  }

  IntrinsicDelaunay result() const {
    IntrinsicDelaunay out;
    const Index n = static_cast<Index>(halfedge_.size());
    out.edges.resize(n, 2);
    out.weights.resize(n);
    out.eta.resize(eta_.rows(), n);
    for (Index e = 0; e < n; ++e) {
      const Index h = halfedge_[e];
      out.edges.row(e) << slots_[h].tail, slots_[mesh::SurfaceTopology::next(h)].tail;
      out.weights[e] = weight(e);
      out.eta.col(e) = eta_.col(h);
    }
    return out;
  }

 private:
  struct Slot {
    Index tail, twin, edge;
    double length;
  };

  // (b^2 + c^2 - a^2) / (4 area), the area by Heron's formula in Kahan's stable order.
  double opposite_cotangent(Index h) const {
    const double a = slots_[h].length;
    const double b = slots_[mesh::SurfaceTopology::next(h)].length;
    const double c = slots_[mesh::SurfaceTopology::prev(h)].length;
    double x = a, y = b, z = c;
    if (x < y) std::swap(x, y);
    if (x < z) std::swap(x, z);
    if (y < z) std::swap(y, z);
    const double product = (x + (y + z)) * (z - (x - y)) * (z + (x - y)) * (x + (y - z));
    return (b * b + c * c - a * a) / std::sqrt(std::max(product, 1e-300));
  }

  // Replaces the diagonal ab of the quadrilateral a d b c by cd; returns the four sides.
  std::array<Index, 4> flip(Index h) {
    const Index t = slots_[h].twin;
    const Index hn = mesh::SurfaceTopology::next(h), hp = mesh::SurfaceTopology::prev(h);
    const Index tn = mesh::SurfaceTopology::next(t), tp = mesh::SurfaceTopology::prev(t);
    const double diagonal = other_diagonal(h, t);
    const std::array<Index, 4> from{tp, hn, hp, tn};  // d->b, b->c, c->a, a->d
    const std::array<Index, 4> to{hn, hp, tn, tp};    // face of h: c d b, face of t: d c a
    std::array<Slot, 4> sides;
    Eigen::Matrix<Index, Eigen::Dynamic, 4> side_eta(eta_.rows(), 4);
    for (int k = 0; k < 4; ++k) {
      sides[k] = slots_[from[k]];
      side_eta.col(k) = eta_.col(from[k]);
    }
    const Index c = sides[2].tail, d = sides[0].tail;
    for (int k = 0; k < 4; ++k) {
      for (int j = 0; j < 4; ++j) {  // a side may be glued to another side
        if (sides[k].twin == from[j]) {
          sides[k].twin = to[j];
          break;
        }
      }
      slots_[to[k]] = sides[k];
      slots_[sides[k].twin].twin = to[k];
      eta_.col(to[k]) = side_eta.col(k);
      halfedge_[sides[k].edge] = to[k];
    }
    slots_[h] = {c, t, slots_[h].edge, diagonal};
    slots_[t] = {d, h, slots_[h].edge, diagonal};
    eta_.col(h) = side_eta.col(2) + side_eta.col(3);
    eta_.col(t) = -eta_.col(h);
    return to;
  }

  // Length of cd after the two triangles at ab are laid flat: c above, d below the x-axis.
  double other_diagonal(Index h, Index t) const {
    const auto apex = [&](double ab, double from_a, double from_b) {
      const double x = (ab * ab + from_a * from_a - from_b * from_b) / (2.0 * ab);
      return Eigen::Vector2d(x, std::sqrt(std::max(from_a * from_a - x * x, 0.0)));
    };
    const double ab = slots_[h].length;
    const Eigen::Vector2d c = apex(ab, slots_[mesh::SurfaceTopology::prev(h)].length,
                                   slots_[mesh::SurfaceTopology::next(h)].length);
    const Eigen::Vector2d d = apex(ab, slots_[mesh::SurfaceTopology::next(t)].length,
                                   slots_[mesh::SurfaceTopology::prev(t)].length);
    return std::hypot(c[0] - d[0], c[1] + d[1]);
  }

  std::vector<Slot> slots_;
  std::vector<Index> halfedge_;  // one half-edge of each edge
  IndexRows eta_;                // (k, 3m) forms along half-edges
};

}  // namespace

IntrinsicDelaunay intrinsic_delaunay(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                                     const Eigen::Ref<const IndexRows>& eta) {
  Flipper flipper(top, edge_length, eta);
  const Index n_flips = flipper.run();
  IntrinsicDelaunay result = flipper.result();
  result.n_flips = n_flips;
  return result;
}

}  // namespace stretchmap::forms
