#include "homology/face_cut.hpp"

#include <algorithm>
#include <utility>

namespace stretchmap::homology {
namespace {

// A flow from faces with supply to faces with demand, across half-edges.
class FaceFlow {
 public:
  FaceFlow(const mesh::SurfaceTopology& top, Vec capacity, Vec supply)
      : top_(top),
        capacity_(std::move(capacity)),
        supply_(std::move(supply)),
        layer_(supply_.size()),
        turn_(supply_.size()) {}

  // Numbers the faces by the steps from supply, no farther than the nearest demand; false where
  // none is reached.
  bool number_layers() {
    std::fill(layer_.begin(), layer_.end(), -1);
    queue_.clear();
    for (Index f = 0; f < supply_.size(); ++f)
      if (supply_[f] > 0.0) reach(f, 0);
    n_sources_ = queue_.size();
    for (std::size_t at = 0; at < queue_.size(); ++at) {
      const Index f = queue_[at];
      if (supply_[f] < 0.0) return true;
      for (Index h = 3 * f; h < 3 * f + 3; ++h)
        if (const Index g = top_.twin[h] / 3; capacity_[h] > 0.0 && layer_[g] < 0)
          reach(g, layer_[f] + 1);
    }
    return false;
  }

  // Sends what can go from layer to layer.
  void saturate() {
    for (std::size_t k = 0; k < n_sources_; ++k) {
      const Index source = queue_[k];
      while (supply_[source] > 0.0 && find_path(source)) send(source);
    }
  }

  std::vector<char> reached() const {
    std::vector<char> taken(layer_.size());
    for (std::size_t f = 0; f < taken.size(); ++f) taken[f] = layer_[f] >= 0;
    return taken;
  }

 private:
  void reach(Index f, Index layer) {
    layer_[f] = layer;
    turn_[f] = 0;
    queue_.push_back(f);
  }

  Index end(Index source) const { return path_.empty() ? source : top_.twin[path_.back()] / 3; }

  bool find_path(Index source) {
    path_.clear();
    Index f = source;
    while (!(supply_[f] < 0.0)) {
      for (; turn_[f] < 3; ++turn_[f]) {
        const Index h = 3 * f + turn_[f];
        if (capacity_[h] > 0.0 && layer_[top_.twin[h] / 3] == layer_[f] + 1) break;
      }
      if (turn_[f] < 3) {
        path_.push_back(3 * f + turn_[f]);
      } else {
        if (path_.empty()) return false;
        path_.pop_back();
        ++turn_[end(source)];
      }
      f = end(source);
    }
    return true;
  }

  void send(Index source) {
    const Index sink = end(source);
    double amount = std::min(supply_[source], -supply_[sink]);
    for (const Index h : path_) amount = std::min(amount, capacity_[h]);
    supply_[source] -= amount;
    supply_[sink] += amount;
    for (const Index h : path_) {
      capacity_[h] -= amount;
      capacity_[top_.twin[h]] += amount;
    }
  }

  const mesh::SurfaceTopology& top_;
  Vec capacity_, supply_;            // what is left of them
  std::vector<Index> layer_, turn_;  // of each face; the half-edge to try next
  std::vector<Index> queue_, path_;
  std::size_t n_sources_ = 0;
};

}  // namespace

std::vector<char> least_cut(const mesh::SurfaceTopology& top, Vec capacity, Vec supply,
                            const Poll& poll) {
  FaceFlow flow(top, std::move(capacity), std::move(supply));
  while (flow.number_layers()) {
    if (poll) poll();
    flow.saturate();
  }
  return flow.reached();
}

}  // namespace stretchmap::homology
