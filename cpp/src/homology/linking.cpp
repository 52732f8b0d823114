#include "stretchmap/homology/linking.hpp"

#include <cmath>
#include <complex>
#include <string>
#include <utility>

#include "stretchmap/base/errors.hpp"

namespace stretchmap {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Difference {
  Eigen::Vector3d vector;
  double length;
};

// exp(i Omega / 2) times a positive factor, Omega the solid angle of triangle abc at the origin.
std::complex<double> half_angle(const Difference& a, const Difference& b, const Difference& c) {
  const double volume = a.vector.dot(b.vector.cross(c.vector));
  const double base = a.length * b.length * c.length + a.vector.dot(b.vector) * c.length +
                      b.vector.dot(c.vector) * a.length + c.vector.dot(a.vector) * b.length;
  return {base, volume};
}

// Sums the half solid angles of many segment pairs. Small angles are multiplied up as complex
// numbers, so that one arctangent serves up to eight pairs; larger ones take their own.
class AngleSum {
 public:
  void add(const std::complex<double>& pair) {
    if (pair.real() <= 0.0 || std::abs(pair.imag()) > 0.3 * pair.real()) {
      total_ += std::arg(pair);
      return;
    }
    product_ *= pair / pair.real();
    if (++count_ == 8) flush();
  }
  double total() {
    flush();
    return total_;
  }

 private:
  void flush() {
    total_ += std::arg(product_);
    product_ = 1.0;
    count_ = 0;
  }
  double total_ = 0.0;
  std::complex<double> product_ = 1.0;
  int count_ = 0;
};

// Gauss integral of closed polygons p, q; touches(i, j) tells that segment i of p and segment j of
// q meet, in which case the pair counts zero.
template <class Touches>
double gauss_integral(const PointsRef& p, const PointsRef& q, const Touches& touches) {
  const Index np = static_cast<Index>(p.rows()), nq = static_cast<Index>(q.rows());
  std::vector<Difference> here(np), there(np);
  const auto fill = [&](std::vector<Difference>& row, Index j) {
    for (Index i = 0; i < np; ++i) {
      row[i].vector = (q.row(j) - p.row(i)).transpose();
      row[i].length = row[i].vector.norm();
    }
  };
  AngleSum sum;
  fill(here, 0);
  for (Index j = 0; j < nq; ++j) {
    fill(there, (j + 1) % nq);
    for (Index i = 0; i < np; ++i) {
      if (touches(i, j)) continue;
      const Index k = i + 1 == np ? 0 : i + 1;
      std::complex<double> first = half_angle(here[i], here[k], there[k]);
      std::complex<double> second = half_angle(here[i], there[k], there[i]);
      sum.add(first * second);
    }
    std::swap(here, there);
  }
  return sum.total() / (2.0 * kPi);
}

// The half-edges that the loop on the left of `loop` crosses, each from its left to its right side.
std::vector<Index> left_crossings(const SurfaceTopology& top, const Loop& loop) {
  const std::vector<Index> along = loop_halfedges(top, loop);
  std::vector<Index> crossings, fan;
  for (std::size_t k = 0; k < along.size(); ++k) {
    const Index incoming = along[(k + along.size() - 1) % along.size()];
    fan.clear();
    for (Index h = top.twin[SurfaceTopology::prev(along[k])]; h != top.twin[incoming];
         h = top.twin[SurfaceTopology::prev(h)]) {
      fan.push_back(h);
    }
    crossings.insert(crossings.end(), fan.rbegin(), fan.rend());
  }
  return crossings;
}

// Dihedral angle outside the surface at the edge of half-edge h, over 2 pi: one half where flat.
double exterior_turns(const SurfaceTopology& top, const PointsRef& points, Index h) {
  const auto normal = [&](Index f) -> Eigen::Vector3d {
    const Eigen::Vector3d x = points.row(top.faces(f, 0));
    const Eigen::Vector3d y = points.row(top.faces(f, 1));
    const Eigen::Vector3d z = points.row(top.faces(f, 2));
    return (y - x).cross(z - x);
  };
  const Eigen::Vector3d left = normal(h / 3), right = normal(top.twin[h] / 3);
  const Eigen::Vector3d along = (points.row(top.head(h)) - points.row(top.tail(h))).normalized();
  const double bend = std::atan2(along.dot(left.cross(right)), left.dot(right));
  return 0.5 + bend / (2.0 * kPi);
}

}  // namespace

double gauss_linking(const PointsRef& p, const PointsRef& q) {
  return gauss_integral(p, q, [](Index, Index) { return false; });
}

Rows linking_matrix(const SurfaceTopology& top, const PointsRef& points,
                    const std::vector<Loop>& loops, const Poll& poll) {
  const Index n = static_cast<Index>(loops.size());
  Rows matrix(n, n);
  for (Index j = 0; j < n; ++j) {
    const std::vector<Index> crossings = left_crossings(top, loops[j]);
    const Index nq = static_cast<Index>(crossings.size());
    Points midpoints(nq, 3);
    for (Index k = 0; k < nq; ++k) {
      midpoints.row(k) =
          0.5 * (points.row(top.tail(crossings[k])) + points.row(top.head(crossings[k])));
    }
    for (Index i = 0; i < n; ++i) {
      if (poll) poll();
      const std::vector<Index> along = loop_halfedges(top, loops[i]);
      const Index np = static_cast<Index>(along.size());
      Points polygon(np, 3);
      std::vector<Index> direction(top.edges.rows(), 0);
      for (Index k = 0; k < np; ++k) {
        polygon.row(k) = points.row(top.tail(along[k]));
        direction[top.edge[along[k]]] = top.sign(along[k]) > 0 ? 1 : -1;
      }
      double lifted = 0.0;
      for (const Index h : crossings) {
        const Index run = direction[top.edge[h]];
        if (run != 0) lifted += run * top.sign(h) * exterior_turns(top, points, h);
      }
      const double integral = gauss_integral(polygon, midpoints, [&](Index s, Index t) {
        const Index e = top.edge[along[s]];
        return e == top.edge[crossings[t]] || e == top.edge[crossings[(t + 1) % nq]];
      });
      matrix(i, j) = integral + lifted;
      if (!(std::abs(matrix(i, j) - std::round(matrix(i, j))) < 1e-6)) {
        throw Error("SolverError",
                    "the linking number of loops " + std::to_string(i) + " and " +
                        std::to_string(j) + " came out as " + std::to_string(matrix(i, j)) +
                        ", not an integer: the surface crosses itself or has degenerate faces");
      }
    }
  }
  return matrix;
}

}  // namespace stretchmap
