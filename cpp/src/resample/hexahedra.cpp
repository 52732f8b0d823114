#include "stretchmap/resample/hexahedra.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::resample {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 8>;
using Coefficients = std::array<double, 27>;

constexpr int kMostHalvings = 60;  // twenty of each direction
// Parts of one hexahedron that are looked at: one whose determinant comes near zero along a surface
// has their number grow with every halving, and counts as not proven positive.
constexpr int kMostParts = 10'000'000;  // half a second
constexpr Index kBatch = 1024;          // hexahedra between two polls
constexpr int kStride[3] = {9, 3, 1};

// Corner at the ends (i, j, k) of the three directions.
constexpr int kAt[2][2][2] = {{{0, 4}, {3, 7}}, {{1, 5}, {2, 6}}};

constexpr int at(int i, int j, int k) { return 9 * i + 3 * j + k; }

double det(const Vector3d& a, const Vector3d& b, const Vector3d& c) { return a.dot(b.cross(c)); }

Corners corners_of(const PointsRef& points, const HexesRef& hexes, Index h) {
  Corners out;
  for (int c = 0; c < 8; ++c) out[c] = points.row(hexes(h, c)).transpose();
  return out;
}

// Edge of direction d at the ends (i, j, k); the end along d does not matter.
Vector3d edge(const Corners& x, int d, int i, int j, int k) {
  int low[3] = {i, j, k}, high[3] = {i, j, k};
  low[d] = 0;
  high[d] = 1;
  return x[kAt[high[0]][high[1]][high[2]]] - x[kAt[low[0]][low[1]][low[2]]];
}

// The coefficient in the middle of an edge of direction d, from the determinants half-way and at
// its ends: J(1/2) = (b0 + 2 b1 + b2) / 4.
double middle_of_edge(const Corners& x, int d, const std::array<int, 3>& e, double b0, double b2) {
  std::array<Vector3d, 3> column;
  for (int c = 0; c < 3; ++c) {
    std::array<int, 3> first = e, last = e;
    first[d] = 0;
    last[d] = 1;
    column[c] =
        0.5 * (edge(x, c, first[0], first[1], first[2]) + edge(x, c, last[0], last[1], last[2]));
  }
  return 2.0 * det(column[0], column[1], column[2]) - 0.5 * (b0 + b2);
}

// The mean of a three by three net whose second mixed difference vanishes: (2 sum of the middles of
// the sides - sum of the corners) / 4.
double middle_of_face(const Coefficients& b, int center, int p, int q) {
  const double sides = b[center - p] + b[center + p] + b[center - q] + b[center + q];
  const double ends = b[center - p - q] + b[center - p + q] + b[center + p - q] + b[center + p + q];
  return 0.5 * sides - 0.25 * ends;
}

// What rounding can do to a coefficient. With u half an epsilon and edges no longer than s in any
// coordinate a determinant is below 6 s^3 and off by less than 40 u s^3, the coefficients of edges,
// faces, center below 18, 42, 102 s^3 and off by less than 120, 280, 680 u s^3; each halving adds
// 2 u times the largest of them: 680 + 204 kMostHalvings < 16384.
double rounding_bound(const Corners& x) {
  Vector3d low = x[0], high = x[0];
  for (const Vector3d& p : x) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double span = (high - low).maxCoeff();
  return 8192.0 * std::numeric_limits<double>::epsilon() * span * span * span;
}

// Halves a net along the direction with this stride by de Casteljau's algorithm.
void halve(const Coefficients& b, int stride, Coefficients& low, Coefficients& high) {
  const int others[2] = {stride == 9 ? 3 : 9, stride == 1 ? 3 : 1};
  for (int p = 0; p < 3; ++p)
    for (int q = 0; q < 3; ++q) {
      const int first = p * others[0] + q * others[1];
      const double b0 = b[first], b1 = b[first + stride], b2 = b[first + 2 * stride];
      const double left = 0.5 * (b0 + b1), right = 0.5 * (b1 + b2), middle = 0.5 * (left + right);
      low[first] = b0, low[first + stride] = left, low[first + 2 * stride] = middle;
      high[first] = middle, high[first + stride] = right, high[first + 2 * stride] = b2;
    }
}

bool corner_at_most(const Coefficients& b, double bound) {
  for (int i = 0; i < 3; i += 2)
    for (int j = 0; j < 3; j += 2)
      for (int k = 0; k < 3; k += 2)
        if (!(b[at(i, j, k)] > bound)) return true;
  return false;
}

bool all_above(const Coefficients& b, double bound) {
  return std::all_of(b.begin(), b.end(), [bound](double value) { return value > bound; });
}

bool positive(const Coefficients& whole, double bound) {
  struct Part {
    Coefficients net;
    int halvings;
  };
  if (corner_at_most(whole, bound)) return false;
  if (all_above(whole, bound)) return true;
  std::vector<Part> open = {{whole, 0}};
  for (int parts = 0; !open.empty(); ++parts) {
    if (parts == kMostParts) return false;
    const Part part = open.back();
    open.pop_back();
    if (part.halvings == kMostHalvings) return false;
    Part half[2];
    halve(part.net, kStride[part.halvings % 3], half[0].net, half[1].net);
    for (Part& h : half) {
      h.halvings = part.halvings + 1;
      if (corner_at_most(h.net, bound)) return false;
      if (!all_above(h.net, bound)) open.push_back(h);
    }
  }
  return true;
}

int slot_of(int corner, int neighbor) {
  for (int a = 0; a < 3; ++a)
    if (kCorners[corner][a + 1] == neighbor) return 3 * corner + a;
  return -1;
}

// Corner of the face with the corners a, o, b that is not one of them.
int across(int a, int o, int b) {
  for (int i = 1; i < 4; ++i)
    for (int j = 1; j < 4; ++j)
      if (kCorners[a][i] == kCorners[b][j] && kCorners[a][i] != o) return kCorners[a][i];
  return -1;
}

std::array<EdgeTriple, 32> make_edge_triples() {
  std::array<EdgeTriple, 32> out;
  int at = 8;
  for (int a = 0; a < 8; ++a) {
    const auto& c = kCorners[a];
    out[a] = {c, {3 * a, 3 * a + 1, 3 * a + 2}, 0};
    for (int i = 0; i < 3; ++i) {
      const int b = c[i + 1], second = c[(i + 1) % 3 + 1], third = c[(i + 2) % 3 + 1];
      if (b < a) continue;
      const int q = across(b, a, second), p = across(b, a, third);
      out[at++] = {{a, b, second, p}, {slot_of(a, b), slot_of(a, second), slot_of(b, p)}, 2};
      out[at++] = {{a, b, q, third}, {slot_of(a, b), slot_of(b, q), slot_of(a, third)}, 1};
    }
  }
  return out;
}

}  // namespace

const std::array<EdgeTriple, 32>& edge_triples() {
  static const std::array<EdgeTriple, 32> triples = make_edge_triples();
  return triples;
}

Coefficients jacobian_coefficients(const Corners& x) {
  Coefficients b;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      for (int k = 0; k < 2; ++k)
        b[at(2 * i, 2 * j, 2 * k)] =
            det(edge(x, 0, i, j, k), edge(x, 1, i, j, k), edge(x, 2, i, j, k));
  for (int p = 0; p < 3; p += 2)
    for (int q = 0; q < 3; q += 2) {
      const std::array<int, 3> ends[3] = {{0, p / 2, q / 2}, {p / 2, 0, q / 2}, {p / 2, q / 2, 0}};
      const int middle[3] = {at(1, p, q), at(p, 1, q), at(p, q, 1)};
      for (int d = 0; d < 3; ++d)
        b[middle[d]] =
            middle_of_edge(x, d, ends[d], b[middle[d] - kStride[d]], b[middle[d] + kStride[d]]);
    }
  for (int p = 0; p < 3; p += 2) {
    b[at(p, 1, 1)] = middle_of_face(b, at(p, 1, 1), 3, 1);
    b[at(1, p, 1)] = middle_of_face(b, at(1, p, 1), 9, 1);
    b[at(1, 1, p)] = middle_of_face(b, at(1, 1, p), 9, 3);
  }
  b[at(1, 1, 1)] = middle_of_face(b, at(1, 1, 1), 9, 3);
  return b;
}

Flags valid_hexes(const PointsRef& points, const HexesRef& hexes, const Poll& poll) {
  const Index k = static_cast<Index>(hexes.rows());
  Flags valid(k);
  for (Index begin = 0; begin < k; begin += kBatch) {
    if (poll) poll();
    for_rows(std::min(kBatch, k - begin), kCostlyChunk, [&](Index row) {
      const Corners x = corners_of(points, hexes, begin + row);
      valid[begin + row] = positive(jacobian_coefficients(x), rounding_bound(x));
    });
  }
  return valid;
}

Rows8 scaled_jacobians(const PointsRef& points, const HexesRef& hexes) {
  const Index k = static_cast<Index>(hexes.rows());
  Rows8 out(k, 8);
  for_rows(k, kElementChunk, [&](Index h) {
    const Corners x = corners_of(points, hexes, h);
    for (int c = 0; c < 8; ++c) {
      const Vector3d a = x[kCorners[c][1]] - x[c], b = x[kCorners[c][2]] - x[c],
                     d = x[kCorners[c][3]] - x[c];
      const double lengths = a.norm() * b.norm() * d.norm();
      out(h, c) = lengths > 0.0 ? det(a, b, d) / lengths : 0.0;
    }
  });
  return out;
}

Rows24 corner_sides(const PointsRef& points, const HexesRef& hexes) {
  const Index k = static_cast<Index>(hexes.rows());
  Rows24 out(k, 24);
  for_rows(k, kElementChunk, [&](Index h) {
    for (int c = 0; c < 8; ++c)
      for (int a = 0; a < 3; ++a)
        out(h, 3 * c + a) =
            (points.row(hexes(h, kCorners[c][a + 1])) - points.row(hexes(h, c))).norm();
  });
  return out;
}

Vec least_edge_jacobians(const PointsRef& points, const HexesRef& hexes) {
  const Index k = static_cast<Index>(hexes.rows());
  const auto& triples = edge_triples();
  Vec out(k);
  for_rows(k, kElementChunk, [&](Index h) {
    const Corners x = corners_of(points, hexes, h);
    out[h] = 1.0;
    for (int t = 8; t < 32; ++t) {
      const auto& [c, side, far] = triples[t];
      const Vector3d a = x[c[1]] - x[c[0]], b = x[c[2]] - x[far == 1 ? c[1] : c[0]],
                     d = x[c[3]] - x[far == 2 ? c[1] : c[0]];
      const double lengths = a.norm() * b.norm() * d.norm();
      out[h] = std::min(out[h], lengths > 0.0 ? det(a, b, d) / lengths : 0.0);
    }
  });
  return out;
}

Vec hex_volumes(const PointsRef& points, const HexesRef& hexes) {
  const Index k = static_cast<Index>(hexes.rows());
  Vec out(k);
  for_rows(k, kElementChunk, [&](Index h) {
    // The mean of a polynomial is that of its Bernstein coefficients.
    double sum = 0.0;
    for (const double b : jacobian_coefficients(corners_of(points, hexes, h))) sum += b;
    out[h] = sum / 27.0;
  });
  return out;
}

}  // namespace stretchmap::resample
