#include "stretchmap/volume/line_bound.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

namespace stretchmap::volume {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// What is left of a volume when a tet counts as flat.
constexpr double kFlat = 1e-6;
constexpr double kShortest = 1e-12;  // part of the line that is not divided further

// Cubic along a line, written round the point reached so far.
struct Cubic {
  double c0, c1, c2, c3;

  double at(double a) const { return c0 + a * (c1 + a * (c2 + a * c3)); }
  Cubic seen_from(double a) const {
    return {at(a), c1 + a * (2.0 * c2 + 3.0 * a * c3), c2 + 3.0 * a * c3, c3};
  }
  // Positive Bernstein coefficients on [0, h] prove that there is no root.
  bool positive_up_to(double h) const {
    return c0 > 0.0 && 3.0 * c0 + c1 * h > 0.0 && 3.0 * c0 + h * (2.0 * c1 + c2 * h) > 0.0 &&
           at(h) > 0.0;
  }
};

// \return how far in (0, limit] the cubic is proven positive, short of its first root by no more
//         than a value of kFlat times the first.
double positive_length(const Cubic& whole, double limit) {
  double reached = 0.0, h = limit;
  Cubic rest = whole;
  while (reached < limit && rest.c0 > kFlat * whole.c0 && h > kShortest * limit) {
    if (!rest.positive_up_to(h)) {
      h *= 0.5;
      continue;
    }
    reached += h;
    rest = whole.seen_from(reached);
    h = std::min(2.0 * h, limit - reached);
  }
  return std::min(reached, limit);
}

}  // namespace

Vec longest_steps(const TetsRef& tets, const PointsRef& x, const PointsRef& direction,
                  double limit) {
  const Index k = static_cast<Index>(tets.rows());
  Vec longest = Vec::Constant(k, limit);
#pragma omp parallel for schedule(static)
  for (Index t = 0; t < k; ++t) {
    Matrix3d E, D;
    for (int a = 1; a < 4; ++a) {
      E.col(a - 1) = x.row(tets(t, a)) - x.row(tets(t, 0));
      D.col(a - 1) = direction.row(tets(t, a)) - direction.row(tets(t, 0));
    }
    const double d0 = E.determinant();
    if (!(d0 > 0.0)) continue;
    const auto det = [](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
      return a.dot(b.cross(c));
    };
    const double d1 = det(D.col(0), E.col(1), E.col(2)) + det(E.col(0), D.col(1), E.col(2)) +
                      det(E.col(0), E.col(1), D.col(2));
    const double d2 = det(D.col(0), D.col(1), E.col(2)) + det(D.col(0), E.col(1), D.col(2)) +
                      det(E.col(0), D.col(1), D.col(2));
    longest[t] = positive_length({d0, d1, d2, D.determinant()}, limit);
  }
  return longest;
}

}  // namespace stretchmap::volume
