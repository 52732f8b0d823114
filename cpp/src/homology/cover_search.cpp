#include "homology/cover_search.hpp"

#include <algorithm>
#include <utility>

namespace stretchmap::homology {

CoverSearch::CoverSearch(const mesh::SurfaceTopology& top, const VecRef& edge_length,
                         const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target,
                         Poll poll, double limit, std::int64_t most_settled)
    : poll_(std::move(poll)),
      n_vertices_(top.n_vertices),
      most_settled_(most_settled),
      best_(limit) {
  const std::vector<Index> move = number_moves(forms);
  const Sheet there(target.data(), target.data() + target.size());
  forward_ = static_cast<Index>(moves_.size());
  backward_ = forward_ + 1;
  for (const Index sign : {1, -1}) {
    moves_.push_back(there);
    for (Index& step : moves_.back()) step *= sign;
  }
  arcs_ = Incidence<Arc>(n_vertices_, [&](const auto& visit) {
    for (Index h = 0; h < top.twin.size(); ++h) {
      const Index e = top.edge[h], i = top.tail(h), j = top.head(h);
      const Index turn = move[e] == 0 || i < j ? 0 : 1;
      visit(i, Arc{edge_length[e], j, 2 * move[e] + turn});
    }
  });
  origin_ = sheet_id(Sheet(target.size(), 0));
}

double CoverSearch::search_from(Index v, double cutoff) {
  ++stamp_;
  limit_ = cutoff;
  queue_ = {};
  node(origin_, v) = {0.0, stamp_, -1, -1};
  queue_.push({0.0, origin_, v});
  while (!queue_.empty() && !is_exhausted()) {
    const auto [distance, sheet, i] = queue_.top();
    queue_.pop();
    if (2.0 * distance > limit_) break;
    if (distance > node(sheet, i).distance) continue;
    if (++settled_ % 4096 == 0 && poll_) poll_();
    settle(sheet, i, distance);
  }
  return limit_;
}

// Edges move between sheets in few different ways. Returns for each edge the number of its pair of
// moves, 0 where it stays in the sheet.
std::vector<Index> CoverSearch::number_moves(const Eigen::Ref<const IndexRows>& forms) {
  std::vector<Index> move(forms.cols());
  moves_.assign(2, Sheet(forms.rows(), 0));
  std::map<Sheet, Index> numbers;
  Sheet column(forms.rows());
  for (Index e = 0; e < forms.cols(); ++e) {
    bool moves = false;
    for (Index k = 0; k < forms.rows(); ++k) {
      column[k] = forms(k, e);
      moves = moves || column[k] != 0;
    }
    if (!moves) continue;
    const auto [found, is_new] = numbers.emplace(column, static_cast<Index>(moves_.size() / 2));
    move[e] = found->second;
    if (!is_new) continue;
    moves_.push_back(column);
    moves_.push_back(column);
    for (Index& step : moves_.back()) step = -step;
  }
  return move;
}

Index CoverSearch::sheet_id(const Sheet& sheet) {
  const auto [found, is_new] = ids_.emplace(sheet, static_cast<Index>(sheets_.size()));
  if (is_new) {
    sheets_.push_back(sheet);
    pages_.emplace_back(n_vertices_ / kPage + 1);
    next_.emplace_back(moves_.size(), -1);
  }
  return found->second;
}

Index CoverSearch::step(Index sheet, Index move) {
  if (move == 0) return sheet;
  if (next_[sheet][move] < 0) {
    Sheet moved = sheets_[sheet];
    for (std::size_t k = 0; k < moved.size(); ++k) moved[k] += moves_[move][k];
    const Index id = sheet_id(moved);
    next_[sheet][move] = id;
  }
  return next_[sheet][move];
}

CoverSearch::Node& CoverSearch::node(Index sheet, Index i) {
  std::unique_ptr<Node[]>& page = pages_[sheet][i / kPage];
  if (!page) page = std::make_unique<Node[]>(kPage);
  return page[i % kPage];
}

// On a shortest loop some edge joins the half nearer to the source to the half nearer to its
// translate. Whichever end is settled last finds the other's label, so labels are written beyond
// half the limit, though not searched from.
void CoverSearch::settle(Index sheet, Index i, double distance) {
  meet(sheet, i, step(sheet, forward_), distance);
  meet(sheet, i, step(sheet, backward_), distance);
  for (const Arc& arc : arcs_[i]) {
    const double candidate = distance + arc.length;
    if (candidate >= limit_) continue;
    const Index there = step(sheet, arc.move);
    Node& known = node(there, arc.to);
    if (known.stamp == stamp_ && candidate >= known.distance) continue;
    known = {candidate, stamp_, i, sheet};
    if (2.0 * candidate <= limit_) queue_.push({candidate, there, arc.to});
  }
}

// Vertex i is known in two sheets that differ by the target: the two paths from the source close a
// loop of the class, or of its opposite.
void CoverSearch::meet(Index sheet, Index i, Index other, double distance) {
  const Node* page = pages_[other][i / kPage].get();
  if (!page || page[i % kPage].stamp != stamp_) return;
  const double length = distance + page[i % kPage].distance;
  if (length >= limit_) return;
  limit_ = length;
  if (length >= best_) return;
  best_ = length;
  loop_ = path_to(sheet, i);
  const Loop back = path_to(other, i);
  loop_.insert(loop_.end(), back.rbegin() + 1, back.rend() - 1);
}

Loop CoverSearch::path_to(Index sheet, Index i) {
  Loop path{i};
  for (const Node* last = &node(sheet, i); last->from >= 0; last = &node(sheet, i)) {
    i = last->from;
    sheet = last->sheet;
    path.push_back(i);
  }
  std::reverse(path.begin(), path.end());
  return path;
}

}  // namespace stretchmap::homology
