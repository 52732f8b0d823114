#include "stretchmap/homology/shortest_loop.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <queue>
#include <utility>

#include "stretchmap/base/errors.hpp"

namespace stretchmap {
namespace {

using Sheet = std::vector<Index>;

// Search of balls in the cover. Sheets are numbered as they are met; the nodes of a sheet lie in
// pages made on first use and are valid when stamped with the current source.
class CoverSearch {
 public:
  CoverSearch(const SurfaceTopology& top, const VecRef& edge_length,
              const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target)
      : top_(top),
        length_(edge_length),
        target_(target.data(), target.data() + target.size()),
        move_(top.edges.rows()) {
    number_moves(forms);
    origin_ = sheet_id(Sheet(target_.size(), 0));
  }

  // Looks for loops through vertex v shorter than `cutoff` and keeps the best. Returns the length
  // of the shortest through v, or the cutoff if that is less.
  double search_from(Index v, double cutoff) {
    ++stamp_;
    limit_ = cutoff;
    queue_ = {};
    reach(origin_, v, 0.0, -1, origin_);
    while (!queue_.empty()) {
      const auto [distance, sheet, i] = queue_.top();
      queue_.pop();
      if (2.0 * distance > limit_) break;
      if (distance > node(sheet, i).distance) continue;
      settle(sheet, i, distance);
    }
    return limit_;
  }

  double best() const { return best_; }
  const Loop& loop() const { return loop_; }

 private:
  static constexpr Index kPage = 128;
  struct Node {
    double distance = 0.0;
    Index stamp = 0;
    Index enter = -1;  // half-edge that enters the vertex
    Index from = -1;   // sheet it comes from
  };
  struct Entry {
    double distance;
    Index sheet, vertex;
    bool operator>(const Entry& other) const { return distance > other.distance; }
  };

  // Edges move between sheets in few different ways; move 0 stays in the sheet.
  void number_moves(const Eigen::Ref<const IndexRows>& forms) {
    std::map<Sheet, Index> numbers{{Sheet(forms.rows(), 0), 0}};
    for (Index e = 0; e < forms.cols(); ++e) {
      Sheet column(forms.rows());
      for (Index k = 0; k < forms.rows(); ++k) column[k] = forms(k, e);
      move_[e] = numbers.emplace(column, static_cast<Index>(numbers.size())).first->second;
    }
    steps_.resize(2 * numbers.size());
    for (const auto& [column, number] : numbers) {
      steps_[2 * number] = steps_[2 * number + 1] = column;
      for (Index& step : steps_[2 * number + 1]) step = -step;
    }
    steps_.push_back(target_);
    steps_.push_back(target_);
    for (Index& step : steps_.back()) step = -step;
  }

  Index sheet_id(const Sheet& sheet) {
    const auto [found, is_new] = ids_.emplace(sheet, static_cast<Index>(sheets_.size()));
    if (is_new) {
      sheets_.push_back(sheet);
      pages_.emplace_back(top_.n_vertices / kPage + 1);
      next_.emplace_back(steps_.size(), -1);
    }
    return found->second;
  }

  Index step(Index sheet, Index which) {
    if (next_[sheet][which] < 0) {
      Sheet moved = sheets_[sheet];
      for (std::size_t k = 0; k < moved.size(); ++k) moved[k] += steps_[which][k];
      const Index id = sheet_id(moved);
      next_[sheet][which] = id;
    }
    return next_[sheet][which];
  }

  // The sheet reached from `sheet` along half-edge h.
  Index across(Index sheet, Index h) {
    const Index move = move_[top_.edge[h]];
    return move == 0 ? sheet : step(sheet, 2 * move + (top_.sign(h) > 0 ? 0 : 1));
  }

  // The sheet translated by the target (forward) or by its opposite.
  Index translated(Index sheet, bool forward) {
    return step(sheet, static_cast<Index>(steps_.size()) - (forward ? 2 : 1));
  }

  Node& node(Index sheet, Index i) {
    std::unique_ptr<Node[]>& page = pages_[sheet][i / kPage];
    if (!page) page = std::make_unique<Node[]>(kPage);
    return page[i % kPage];
  }

  void reach(Index sheet, Index i, double distance, Index enter, Index from) {
    node(sheet, i) = {distance, stamp_, enter, from};
    queue_.push({distance, sheet, i});
  }

  void settle(Index sheet, Index i, double distance) {
    const Index first = top_.vertex_halfedge[i];
    Index h = first;
    do {
      const Index j = top_.head(h);
      const Index there = across(sheet, h);
      const double candidate = distance + length_[top_.edge[h]];
      const Node& known = node(there, j);
      if (2.0 * candidate <= limit_ && (known.stamp != stamp_ || candidate < known.distance)) {
        reach(there, j, candidate, h, sheet);
      }
      meet(sheet, i, translated(there, false), j, candidate);
      meet(sheet, i, translated(there, true), j, candidate);
      h = top_.twin[SurfaceTopology::prev(h)];
    } while (h != first);
  }

  // A path to i with one edge more, to j, meets j in a sheet that differs by the target: the two
  // paths from the source close a loop of the class, or of its opposite.
  void meet(Index sheet, Index i, Index other, Index j, double distance) {
    const Node* page = pages_[other][j / kPage].get();
    if (!page || page[j % kPage].stamp != stamp_) return;
    const double length = distance + page[j % kPage].distance;
    if (length >= limit_) return;
    limit_ = length;
    if (length >= best_) return;
    best_ = length;
    loop_ = path_to(sheet, i);
    const Loop back = path_to(other, j);
    loop_.insert(loop_.end(), back.rbegin(), back.rend() - 1);
  }

  Loop path_to(Index sheet, Index i) {
    Loop path{i};
    while (node(sheet, i).enter >= 0) {
      const Node& last = node(sheet, i);
      i = top_.tail(last.enter);
      sheet = last.from;
      path.push_back(i);
    }
    std::reverse(path.begin(), path.end());
    return path;
  }

  const SurfaceTopology& top_;
  const VecRef& length_;
  Sheet target_;
  std::vector<Index> move_;   // how each edge moves between sheets
  std::vector<Sheet> steps_;  // moves forward and back, then the target forward and back
  std::map<Sheet, Index> ids_;
  std::vector<Sheet> sheets_;
  std::vector<std::vector<std::unique_ptr<Node[]>>> pages_;
  std::vector<std::vector<Index>> next_;  // (sheet, step) -> sheet, -1 where not yet known
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue_;
  Index origin_ = 0, stamp_ = 0;
  double best_ = std::numeric_limits<double>::infinity();
  double limit_ = 0.0;  // shortest loop through the current source so far, or its cutoff
  Loop loop_;
};

}  // namespace

Loop shortest_loop(const SurfaceTopology& top, const VecRef& edge_length,
                   const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target,
                   const Loop& crossing, const Poll& poll) {
  const Index n = static_cast<Index>(crossing.size());
  Vec arc(n + 1);  // distance along `crossing` from its first vertex
  arc[0] = 0.0;
  const std::vector<Index> along = loop_halfedges(top, crossing);
  for (Index k = 0; k < n; ++k) arc[k + 1] = arc[k] + edge_length[top.edge[along[k]]];

  CoverSearch search(top, edge_length, forms, target);
  Vec bound = Vec::Zero(n);  // no loop of the class through crossing[k] is shorter
  Index source = 0;
  while (bound.minCoeff(&source) < search.best()) {
    if (poll) poll();
    const double length = search.search_from(crossing[source], 1.25 * search.best());
    for (Index k = 0; k < n; ++k) {
      const double apart = std::abs(arc[k] - arc[source]);
      bound[k] = std::max(bound[k], length - 2.0 * std::min(apart, arc[n] - apart));
    }
    bound[source] = std::numeric_limits<double>::infinity();
  }
  if (search.loop().empty()) {
    throw Error("SolverError", "no loop of the class crosses the loop given");
  }
  Loop loop = search.loop();
  if (periods(top, forms, loop) != target) std::reverse(loop.begin() + 1, loop.end());
  return loop;
}

}  // namespace stretchmap
