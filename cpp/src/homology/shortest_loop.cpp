#include "stretchmap/homology/shortest_loop.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <utility>

#include "stretchmap/base/errors.hpp"

namespace stretchmap {
namespace {

using Sheet = std::vector<Index>;

// Search of balls in the cover. Sheets are numbered as they are met; each has its own row of
// distances, valid when stamped with the current source.
class CoverSearch {
 public:
  CoverSearch(const SurfaceTopology& top, const VecRef& edge_length,
              const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target)
      : top_(top),
        length_(edge_length),
        target_(target.data(), target.data() + target.size()),
        closed_(top.n_vertices, 0),
        move_(top.edges.rows()) {
    number_moves(forms);
    origin_ = sheet_id(Sheet(target_.size(), 0));
  }

  // Looks for a shorter loop through vertex v, then closes v to later searches.
  void search_from(Index v) {
    if (closed_[v]) return;
    ++stamp_;
    queue_ = {};
    reach(origin_, v, 0.0, -1, origin_);
    while (!queue_.empty()) {
      const auto [distance, sheet, i] = queue_.top();
      queue_.pop();
      if (2.0 * distance > best_) break;
      if (distance > rows_[sheet][i].distance) continue;
      settle(sheet, i, distance);
    }
    closed_[v] = 1;
  }

  const Loop& loop() const { return loop_; }

 private:
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
      rows_.emplace_back(top_.n_vertices);
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

  void reach(Index sheet, Index i, double distance, Index enter, Index from) {
    rows_[sheet][i] = {distance, stamp_, enter, from};
    queue_.push({distance, sheet, i});
  }

  void settle(Index sheet, Index i, double distance) {
    const Index first = top_.vertex_halfedge[i];
    Index h = first;
    do {
      const Index j = top_.head(h);
      if (!closed_[j]) {
        const Index there = across(sheet, h);
        const double candidate = distance + length_[top_.edge[h]];
        Node& node = rows_[there][j];
        if (2.0 * candidate <= best_ && (node.stamp != stamp_ || candidate < node.distance)) {
          reach(there, j, candidate, h, sheet);
        }
        meet(sheet, i, translated(there, false), j, candidate);
        meet(sheet, i, translated(there, true), j, candidate);
      }
      h = top_.twin[SurfaceTopology::prev(h)];
    } while (h != first);
  }

  // A path to i with one edge more, to j, meets j in a sheet that differs by the target: the two
  // paths from the source close a loop of the class, or of its opposite.
  void meet(Index sheet, Index i, Index other, Index j, double distance) {
    const Node& node = rows_[other][j];
    if (node.stamp != stamp_ || distance + node.distance >= best_) return;
    best_ = distance + node.distance;
    loop_ = path_to(sheet, i);
    const Loop back = path_to(other, j);
    loop_.insert(loop_.end(), back.rbegin(), back.rend() - 1);
  }

  Loop path_to(Index sheet, Index i) const {
    Loop path{i};
    for (const Node* node = &rows_[sheet][i]; node->enter >= 0; node = &rows_[sheet][i]) {
      i = top_.tail(node->enter);
      sheet = node->from;
      path.push_back(i);
    }
    std::reverse(path.begin(), path.end());
    return path;
  }

  const SurfaceTopology& top_;
  const VecRef& length_;
  Sheet target_;
  std::vector<char> closed_;
  std::vector<Index> move_;   // how each edge moves between sheets
  std::vector<Sheet> steps_;  // moves forward and back, then the target forward and back
  std::map<Sheet, Index> ids_;
  std::vector<Sheet> sheets_;
  std::vector<std::vector<Node>> rows_;
  std::vector<std::vector<Index>> next_;  // (sheet, step) -> sheet, -1 where not yet known
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue_;
  Index origin_ = 0, stamp_ = 0;
  double best_ = std::numeric_limits<double>::infinity();
  Loop loop_;
};

}  // namespace

Loop shortest_loop(const SurfaceTopology& top, const VecRef& edge_length,
                   const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target,
                   const Loop& crossing, const Poll& poll) {
  CoverSearch search(top, edge_length, forms, target);
  for (const Index v : crossing) {
    if (poll) poll();
    search.search_from(v);
  }
  if (search.loop().empty()) {
    throw Error("SolverError", "no loop of the class crosses the loop given");
  }
  Loop loop = search.loop();
  if (periods(top, forms, loop) != target) std::reverse(loop.begin() + 1, loop.end());
  return loop;
}

}  // namespace stretchmap
