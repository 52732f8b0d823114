// Search of balls in the universal abelian cover of a surface.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <queue>
#include <vector>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/homology/tree_cotree.hpp"

namespace stretchmap::homology {

// Nodes of the cover are a vertex and a sheet in Z^k, the sheet changing by the forms along each
// edge. A ball about a vertex meets its translate by the target at half the length of the shortest
// loop of that class through the vertex. Sheets are numbered as they are met; the nodes of a sheet
// lie in pages made on first use and are valid when stamped with the current source.
class CoverSearch {
 public:
  CoverSearch(const mesh::SurfaceTopology& top, const VecRef& edge_length,
              const Eigen::Ref<const IndexRows>& forms, const IndexVecRef& target, Poll poll,
              double limit = std::numeric_limits<double>::infinity(),
              std::int64_t most_settled = std::numeric_limits<std::int64_t>::max());

  // Looks for loops through vertex v shorter than `cutoff` and keeps the best of all searches.
  // Returns the length of the shortest through v, or the cutoff if that is less.
  double search_from(Index v, double cutoff);

  double best() const { return best_; }
  // Nodes were settled as often as they may be: the last search was not finished.
  bool is_exhausted() const { return settled_ >= most_settled_; }
  const Loop& loop() const { return loop_; }

 private:
  using Sheet = std::vector<Index>;
  static constexpr Index kPage = 128;
  struct Node {
    double distance = 0.0;
    Index stamp = 0;
    Index from = -1;   // vertex it comes from, -1 at the source
    Index sheet = -1;  // and that vertex's sheet
  };
  struct Arc {
    double length;
    Index to;
    Index move;
  };
  struct Entry {
    double distance;
    Index sheet, vertex;
    bool operator>(const Entry& other) const { return distance > other.distance; }
  };

  std::vector<Index> number_moves(const Eigen::Ref<const IndexRows>& forms);
  Index sheet_id(const Sheet& sheet);
  Index step(Index sheet, Index move);
  Node& node(Index sheet, Index i);
  void settle(Index sheet, Index i, double distance);
  void meet(Index sheet, Index i, Index other, double distance);
  Loop path_to(Index sheet, Index i);

  Poll poll_;
  Index n_vertices_;
  Incidence<Arc> arcs_;       // of each vertex
  std::vector<Sheet> moves_;  // 0 stays in the sheet; 2 k and 2 k + 1 are opposite
  Index forward_, backward_;  // the moves by the target and by its opposite
  std::map<Sheet, Index> ids_;
  std::vector<Sheet> sheets_;
  std::vector<std::vector<std::unique_ptr<Node[]>>> pages_;
  std::vector<std::vector<Index>> next_;  // (sheet, move) -> sheet, -1 where not yet known
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue_;
  Index origin_ = 0, stamp_ = 0;
  std::int64_t settled_ = 0, most_settled_;
  double best_;
  double limit_ = 0.0;  // shortest loop through the current source so far, or its cutoff
  Loop loop_;
};

}  // namespace stretchmap::homology
