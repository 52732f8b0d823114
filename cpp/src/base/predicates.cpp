#include "stretchmap/base/predicates.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace stretchmap {
namespace {

constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;  // 2^-53

// A real number as an unevaluated sum of doubles that do not overlap, smallest first, no zeros.
class Expansion {
 public:
  Expansion() = default;

  // The difference x - y, without error.
  static Expansion difference(double x, double y) {
    Expansion out;
    const double high = x - y;
    const double y_part = x - high;
    const double x_part = high + y_part;
    out.push((x - x_part) + (y_part - y));
    out.push(high);
    return out;
  }

  // Neither so small that a product of three loses bits nor so large that it overflows.
  bool in_range() const {
    for (const double part : parts_) {
      const double size = std::abs(part);
      if (!(size >= 0x1p-300 && size <= 0x1p300)) return false;
    }
    return true;
  }

  void add(double value) {
    std::size_t kept = 0;
    for (const double part : parts_) {
      const double sum = value + part;
      const double part_share = sum - value;
      const double rest = (value - (sum - part_share)) + (part - part_share);
      if (rest != 0.0) parts_[kept++] = rest;
      value = sum;
    }
    parts_.resize(kept);
    push(value);
  }

  Expansion& operator+=(const Expansion& other) {
    for (const double part : other.parts_) add(part);
    return *this;
  }

  friend Expansion operator*(const Expansion& a, const Expansion& b) {
    Expansion out;
    for (const double x : a.parts_) {
      for (const double y : b.parts_) {
        const double high = x * y;
        out.add(std::fma(x, y, -high));
        out.add(high);
      }
    }
    return out;
  }

  Expansion operator-() const {
    Expansion out = *this;
    for (double& part : out.parts_) part = -part;
    return out;
  }

  int sign() const { return parts_.empty() ? 0 : (parts_.back() > 0.0 ? 1 : -1); }

 private:
  void push(double value) {
    if (value != 0.0) parts_.push_back(value);
  }
  std::vector<double> parts_;
};

Expansion minor(const Expansion& a, const Expansion& b, const Expansion& c, const Expansion& d) {
  Expansion out = a * d;
  out += -(b * c);
  return out;
}

int exact_orient3d(const Point& a, const Point& b, const Point& c, const Point& d) {
  std::array<std::array<Expansion, 3>, 3> row;
  const std::array<const Point*, 3> tip{&b, &c, &d};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      row[i][k] = Expansion::difference((*tip[i])[k], a[k]);
      if (!row[i][k].in_range()) return 0;
    }
  }
  Expansion det = row[0][0] * minor(row[1][1], row[1][2], row[2][1], row[2][2]);
  det += row[0][1] * minor(row[1][2], row[1][0], row[2][2], row[2][0]);
  det += row[0][2] * minor(row[1][0], row[1][1], row[2][0], row[2][1]);
  return det.sign();
}

}  // namespace

int orient3d(const Point& a, const Point& b, const Point& c, const Point& d) {
  const Point p = b - a, q = c - a, r = d - a;
  const double q_y_r_z = q[1] * r[2], q_z_r_y = q[2] * r[1];
  const double q_z_r_x = q[2] * r[0], q_x_r_z = q[0] * r[2];
  const double q_x_r_y = q[0] * r[1], q_y_r_x = q[1] * r[0];
  const double det =
      p[0] * (q_y_r_z - q_z_r_y) + p[1] * (q_z_r_x - q_x_r_z) + p[2] * (q_x_r_y - q_y_r_x);
  const double permanent = std::abs(p[0]) * (std::abs(q_y_r_z) + std::abs(q_z_r_y)) +
                           std::abs(p[1]) * (std::abs(q_z_r_x) + std::abs(q_x_r_z)) +
                           std::abs(p[2]) * (std::abs(q_x_r_y) + std::abs(q_y_r_x));
  // The second term covers products that underflow.
  const double bound =
      (7.0 + 56.0 * kUnit) * kUnit * permanent + 1e-300 * (1.0 + p.cwiseAbs().sum());
  if (det > bound) return 1;
  if (det < -bound) return -1;
  return exact_orient3d(a, b, c, d);
}

int orient2d(const Point& a, const Point& b, const Point& c, int axis) {
  const int i = axis == 0 ? 1 : 0, j = axis == 2 ? 1 : 2;
  const double left = (b[i] - a[i]) * (c[j] - a[j]);
  const double right = (b[j] - a[j]) * (c[i] - a[i]);
  const double det = left - right;
  const double bound = (3.0 + 16.0 * kUnit) * kUnit * (std::abs(left) + std::abs(right)) + 1e-300;
  if (det > bound) return 1;
  if (det < -bound) return -1;
  const std::array<Expansion, 4> exact{
      Expansion::difference(b[i], a[i]), Expansion::difference(b[j], a[j]),
      Expansion::difference(c[i], a[i]), Expansion::difference(c[j], a[j])};
  for (const Expansion& entry : exact) {
    if (!entry.in_range()) return 0;
  }
  return minor(exact[0], exact[1], exact[2], exact[3]).sign();
}

}  // namespace stretchmap
