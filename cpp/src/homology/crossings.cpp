#include "homology/crossings.hpp"

#include <cmath>
#include <utility>
#include <vector>

namespace stretchmap::homology {
namespace {

constexpr Index kLeaf = 4;  // segments that are not split any further

using Point = Eigen::Vector3d;

// Sign of a sum of products, 0 where rounding could decide it: `size` is the sum of their
// magnitudes.
int sign(double value, double size) {
  if (std::abs(value) <= 1e-14 * size) return 0;
  return value > 0.0 ? 1 : -1;
}

// Sign of (a x b).z.
int turn(const Point& a, const Point& b) {
  const double left = a.x() * b.y(), right = a.y() * b.x();
  return sign(left - right, std::abs(left) + std::abs(right));
}

int volume(const Point& a, const Point& b, const Point& c) {
  const Point size = a.cwiseAbs();
  const double products = size.x() * (std::abs(b.y() * c.z()) + std::abs(b.z() * c.y())) +
                          size.y() * (std::abs(b.z() * c.x()) + std::abs(b.x() * c.z())) +
                          size.z() * (std::abs(b.x() * c.y()) + std::abs(b.y() * c.x()));
  return sign(a.dot(b.cross(c)), products);
}

void add(int sense, bool q_above, Crossings& sum) {
  if (q_above) {
    sum.q_above -= sense;
  } else {
    sum.p_above += sense;
  }
}

// Adds the crossing of segments ab of p and cd of q, if any; false where undecided.
bool count_pair(const Point& a, const Point& b, const Point& c, const Point& d, Crossings& sum) {
  const Point along = b - a, other = d - c;
  const int c_side = turn(along, c - a), d_side = turn(along, d - a);
  if (c_side * d_side > 0) return true;
  const int a_side = turn(other, a - c), b_side = turn(other, b - c);
  if (a_side * b_side > 0) return true;
  const int above = volume(c - a, along, other);
  if (c_side * d_side == 0 || a_side * b_side == 0 || above == 0) return false;
  add(d_side, above == d_side, sum);
  return true;
}

// A closed polygon and a binary tree of its runs of segments.
struct Polygon {
  struct Run {
    Index begin, end;         // segments
    Index half, second;       // its halves, -1 in a leaf
    Eigen::AlignedBox2d box;  // of the shadow
  };

  explicit Polygon(const Points& corners) : points(corners), n(static_cast<Index>(corners.rows())) {
    if (n > 0) grow(0, n);
  }

  Index next(Index i) const { return i + 1 == n ? 0 : i + 1; }
  Point point(Index i) const { return points.row(i); }

  Index grow(Index begin, Index end) {
    const Index id = static_cast<Index>(runs.size());
    Run run{begin, end, -1, -1, {}};
    runs.push_back(run);
    if (end - begin <= kLeaf) {
      for (Index i = begin; i < end; ++i) run.box.extend(point(i).head<2>());
      run.box.extend(point(next(end - 1)).head<2>());
    } else {
      const Index middle = begin + (end - begin) / 2;
      run.half = grow(begin, middle);
      run.second = grow(middle, end);
      run.box = runs[run.half].box.merged(runs[run.second].box);
    }
    runs[id] = run;
    return id;
  }

  const Points& points;
  Index n;
  std::vector<Run> runs;
};

// The segments of a run of one polygon against those of a run of the other.
class SegmentPairs {
 public:
  SegmentPairs(const Polygon& first, const Polygon& second, const IndexVecRef& first_mark,
               const IndexVecRef& second_mark)
      : p_(first), q_(second), p_mark_(first_mark), q_mark_(second_mark) {}

  bool count(const Polygon::Run& a, const Polygon::Run& b, Crossings& sum) const {
    for (Index i = a.begin; i < a.end; ++i)
      for (Index j = b.begin; j < b.end; ++j)
        if (!marked(i, j) &&
            !count_pair(p_.point(i), p_.point(p_.next(i)), q_.point(j), q_.point(q_.next(j)), sum))
          return false;
    return true;
  }

 private:
  bool marked(Index i, Index j) const {
    return p_mark_.size() > 0 && (p_mark_[i] == q_mark_[j] || p_mark_[i] == q_mark_[q_.next(j)]);
  }

  const Polygon &p_, &q_;
  const IndexVecRef &p_mark_, &q_mark_;
};

}  // namespace

Eigen::Matrix3d generic_rotation(int k) {
  const double s = 0.6180339887498949 * (k + 1);
  return Eigen::Quaterniond(std::cos(1.0 + s), std::sin(2.0 + 1.7 * s), std::cos(3.0 + 2.3 * s),
                            std::sin(4.0 + 3.1 * s))
      .normalized()
      .toRotationMatrix();
}

bool count_crossings(const Points& p, const Points& q, const IndexVecRef& p_mark,
                     const IndexVecRef& q_mark, Crossings& sum, const Poll& poll) {
  if (p.rows() == 0 || q.rows() == 0) return true;
  const Polygon first(p), second(q);
  const SegmentPairs segments(first, second, p_mark, q_mark);
  std::vector<std::pair<Index, Index>> open{{0, 0}};
  for (std::int64_t done = 0; !open.empty(); ++done) {
    if (poll && done % 65536 == 65535) poll();
    const auto [i, j] = open.back();
    open.pop_back();
    const Polygon::Run &a = first.runs[i], &b = second.runs[j];
    if (!a.box.intersects(b.box)) continue;
    if (a.half < 0 && b.half < 0) {
      if (!segments.count(a, b, sum)) return false;
    } else if (b.half < 0 ||
               (a.half >= 0 && a.box.diagonal().squaredNorm() >= b.box.diagonal().squaredNorm())) {
      open.emplace_back(a.second, j);
      open.emplace_back(a.half, j);
    } else {
      open.emplace_back(i, b.second);
      open.emplace_back(i, b.half);
    }
  }
  return true;
}

// The lift is infinitesimal: the polyline crosses the segment at its midpoint, on its way in, on
// its way out, on both or on none, as the shadow of the lifted midpoint lies.
bool count_touch(const Touch& touch, Crossings& sum) {
  const auto across = [&](const Point& x) {
    return touch.along.x() * x.y() - touch.along.y() * x.x();
  };
  const int lifted = turn(touch.along, touch.lift);
  if (lifted == 0) return false;
  for (const int way : {-1, 1}) {
    const Point& to = way < 0 ? touch.before : touch.after;
    const int side = turn(touch.along, to);
    if (side == 0) return false;
    if (side == lifted) continue;
    const Point meeting = touch.lift - across(touch.lift) / across(to) * to;
    const double share = touch.along.head<2>().dot(meeting.head<2>());
    const double rise = touch.along.z() * share / touch.along.head<2>().squaredNorm();
    const int above = sign(meeting.z() - rise, std::abs(meeting.z()) + std::abs(rise));
    if (above == 0) return false;
    add(way * side, above > 0, sum);
  }
  return true;
}

}  // namespace stretchmap::homology
