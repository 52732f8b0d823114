#include "stretchmap/homology/linking.hpp"

#include <string>

#include "homology/crossings.hpp"
#include "stretchmap/base/errors.hpp"

namespace stretchmap::homology {
namespace {

constexpr int kTries = 8;  // directions of projection

// Where the loop cuts a corner, what runs on its left enters the corner's triangle and turns back:
// over an edge and at once over its twin. Without such pairs, in a circle.
std::vector<Index> without_turning_back(const mesh::SurfaceTopology& top,
                                        const std::vector<Index>& crossings) {
  std::vector<Index> kept;
  for (const Index h : crossings) {
    if (!kept.empty() && kept.back() == top.twin[h])
      kept.pop_back();
    else
      kept.push_back(h);
  }
  std::size_t ends = 0;
  while (2 * ends + 1 < kept.size() && kept[ends] == top.twin[kept[kept.size() - 1 - ends]]) ++ends;
  return {kept.begin() + static_cast<std::ptrdiff_t>(ends),
          kept.end() - static_cast<std::ptrdiff_t>(ends)};
}

// The half-edges that the loop on the left of `loop` crosses, each from its left to its right side.
std::vector<Index> left_crossings(const mesh::SurfaceTopology& top, const Loop& loop) {
  const std::vector<Index> along = loop_halfedges(top, loop);
  std::vector<Index> crossings, fan;
  for (std::size_t k = 0; k < along.size(); ++k) {
    const Index incoming = along[(k + along.size() - 1) % along.size()];
    fan.clear();
    for (Index h = top.turned(along[k]); h != top.twin[incoming]; h = top.turned(h)) {
      fan.push_back(h);
    }
    crossings.insert(crossings.end(), fan.rbegin(), fan.rend());
  }
  return without_turning_back(top, crossings);
}

// A direction out of the solid at the edge of half-edge h.
Eigen::Vector3d outward(const mesh::SurfaceTopology& top, const PointsRef& points, Index h) {
  const auto normal = [&](Index f) -> Eigen::Vector3d {
    const Eigen::Vector3d x = points.row(top.faces(f, 0));
    const Eigen::Vector3d y = points.row(top.faces(f, 1));
    const Eigen::Vector3d z = points.row(top.faces(f, 2));
    return (y - x).cross(z - x).normalized();
  };
  return normal(h / 3) + normal(top.twin[h] / 3);
}

// A loop through the midpoints of edges.
struct MidpointLoop {
  Points points;
  IndexVec edge;   // of each point
  Points outward;  // at each point
};

MidpointLoop loop_on_the_left(const mesh::SurfaceTopology& top, const PointsRef& points,
                              const Loop& loop) {
  const std::vector<Index> crossings = left_crossings(top, loop);
  const Index n = static_cast<Index>(crossings.size());
  MidpointLoop result{Points(n, 3), IndexVec(n), Points(n, 3)};
  for (Index k = 0; k < n; ++k) {
    const Index h = crossings[k];
    result.points.row(k) = 0.5 * (points.row(top.tail(h)) + points.row(top.head(h)));
    result.outward.row(k) = outward(top, points, h);
    result.edge[k] = top.edge[h];
  }
  return result;
}

struct EdgeLoop {
  Points points;
  IndexVec edge;  // from each point to the next
};

EdgeLoop loop_of_edges(const mesh::SurfaceTopology& top, const PointsRef& points,
                       const Loop& loop) {
  const std::vector<Index> along = loop_halfedges(top, loop);
  const Index n = static_cast<Index>(along.size());
  EdgeLoop result{Points(n, 3), IndexVec(n)};
  for (Index k = 0; k < n; ++k) {
    result.points.row(k) = points.row(loop[k]);
    result.edge[k] = top.edge[along[k]];
  }
  return result;
}

// Where c runs through the midpoint of a segment of a.
bool count_touches(const Points& a, const IndexVec& a_edge, const MidpointLoop& c,
                   const Eigen::Matrix3d& rotation, std::vector<Index>& segment, Crossings& sum) {
  const Index n = static_cast<Index>(a_edge.size()), m = static_cast<Index>(c.edge.size());
  for (Index i = 0; i < n; ++i) segment[a_edge[i]] = i;
  bool decided = true;
  for (Index k = 0; k < m && decided; ++k) {
    const Index i = segment[c.edge[k]];
    if (i < 0) continue;
    const auto towards = [&](Index j) -> Eigen::Vector3d {
      return (c.points.row(j) - c.points.row(k)).transpose();
    };
    Touch touch;
    touch.along = (a.row((i + 1) % n) - a.row(i)).transpose();
    touch.before = towards((k + m - 1) % m);
    touch.after = towards((k + 1) % m);
    touch.lift = rotation * c.outward.row(k).transpose();
    decided = count_touch(touch, sum);
  }
  for (Index i = 0; i < n; ++i) segment[a_edge[i]] = -1;
  return decided;
}

// Turns until a projection is decided and gives the same sum above and below; false if none does.
template <class Count>
bool linking(const Count& count, std::int64_t& number) {
  for (int k = 0; k < kTries; ++k) {
    Crossings sum;
    if (!count(generic_rotation(k), sum)) continue;
    number = sum.p_above;
    return sum.p_above == sum.q_above;
  }
  return false;
}

}  // namespace

std::int64_t linking_number(const PointsRef& p, const PointsRef& q, const Poll& poll) {
  const auto count = [&](const Eigen::Matrix3d& rotation, Crossings& sum) {
    const Points first = p * rotation.transpose(), second = q * rotation.transpose();
    return count_crossings(first, second, IndexVec(), IndexVec(), sum, poll);
  };
  std::int64_t number = 0;
  if (!linking(count, number))
    throw Error("SolverError", "the polygons touch; their linking number is not defined");
  return number;
}

LinkingMatrix linking_matrix(const mesh::SurfaceTopology& top, const PointsRef& points,
                             const std::vector<Loop>& loops, const Poll& poll) {
  const Index n = static_cast<Index>(loops.size());
  LinkingMatrix matrix(n, n);
  std::vector<Index> segment(top.edges.rows(), -1);  // of the loop at hand, by edge
  for (Index j = 0; j < n; ++j) {
    const MidpointLoop left = loop_on_the_left(top, points, loops[j]);
    for (Index i = 0; i < n; ++i) {
      if (poll) poll();
      const EdgeLoop loop = loop_of_edges(top, points, loops[i]);
      const auto count = [&](const Eigen::Matrix3d& rotation, Crossings& sum) {
        MidpointLoop lifted = left;
        lifted.points = left.points * rotation.transpose();
        const Points polygon = loop.points * rotation.transpose();
        return count_crossings(polygon, lifted.points, loop.edge, left.edge, sum, poll) &&
               count_touches(polygon, loop.edge, lifted, rotation, segment, sum);
      };
      if (!linking(count, matrix(i, j))) {
        throw Error("SelfIntersectionError",
                    "loops " + std::to_string(i) + " and " + std::to_string(j) +
                        " touch where they should not: the surface has self-intersections or "
                        "degenerate faces; remove these or give the solid");
      }
    }
  }
  return matrix;
}

}  // namespace stretchmap::homology
