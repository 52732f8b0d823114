#include "stretchmap/homology/solid_cohomology.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <utility>

#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/incidence.hpp"

namespace stretchmap::homology {
namespace {

// Integer combination of unknowns, sorted by unknown, no zero coefficients.
using Value = std::vector<std::pair<Index, Index>>;

void add(Value& sum, const Value& term, Index sign) {
  if (term.empty()) return;
  Value merged;
  auto a = sum.begin();
  auto b = term.begin();
  while (a != sum.end() || b != term.end()) {
    if (b == term.end() || (a != sum.end() && a->first < b->first)) {
      merged.push_back(*a++);
    } else if (a == sum.end() || b->first < a->first) {
      merged.emplace_back(b->first, sign * b->second);
      ++b;
    } else {
      const Index coefficient = a->second + sign * b->second;
      if (coefficient != 0) merged.emplace_back(a->first, coefficient);
      ++a;
      ++b;
    }
  }
  sum = std::move(merged);
}

// Corners of the local edges, and for each local face its edges 01, 12, 02 (02 counts negative).
constexpr int kEdge[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
constexpr int kFace[4][3] = {{0, 3, 1}, {0, 4, 2}, {1, 5, 2}, {3, 5, 4}};

class Propagation {
 public:
  Propagation(const TetsRef& tets, const EdgesRef& edges, Index n_vertices, const Poll& poll)
      : edges_(edges),
        poll_(poll),
        value_(edges.rows()),
        known_(edges.rows(), 0),
        first_(n_vertices + 1, 0) {
    for (Index e = 0; e < edges.rows(); ++e) ++first_[edges(e, 0) + 1];
    for (Index i = 0; i < n_vertices; ++i) first_[i + 1] += first_[i];
    index_tets(tets);
  }

  Index find_edge(Index i, Index j) const {
    if (i > j) std::swap(i, j);
    Index low = first_[i], high = first_[i + 1];
    while (low < high) {
      const Index middle = (low + high) / 2;
      if (edges_(middle, 1) < j) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low < first_[i + 1] && edges_(low, 1) == j ? low : -1;
  }

  void run() {
    const std::vector<Index> order = span();
    propagate();
    for (const Index e : order) {
      if (known_[e]) continue;
      learn(e, {{n_unknowns_++, 1}});
      propagate();
    }
  }

  std::set<Value> relations() const {
    std::set<Value> found;
    for (std::size_t t = 0; t < tet_edges_.size(); ++t) {
      if (poll_ && t % 65536 == 0) poll_();
      for (const auto& face : kFace) {
        Value sum = value_[tet_edges_[t][face[0]]];
        add(sum, value_[tet_edges_[t][face[1]]], 1);
        add(sum, value_[tet_edges_[t][face[2]]], -1);
        if (!sum.empty()) found.insert(std::move(sum));
      }
    }
    return found;
  }

  Index n_unknowns() const { return n_unknowns_; }
  const Value& value(Index e) const { return value_[e]; }

 private:
  // Edges of each tet with its corners sorted, so that all local edges run from low to high id.
  void index_tets(const TetsRef& tets) {
    tet_edges_.resize(tets.rows());
    for (Index t = 0; t < tets.rows(); ++t) {
      if (poll_ && t % 65536 == 0) poll_();
      std::array<Index, 4> corner{tets(t, 0), tets(t, 1), tets(t, 2), tets(t, 3)};
      std::sort(corner.begin(), corner.end());
      for (int k = 0; k < 6; ++k) {
        const Index e = find_edge(corner[kEdge[k][0]], corner[kEdge[k][1]]);
        tet_edges_[t][k] = e;
      }
    }
    tets_at_ = Incidence<>(static_cast<Index>(edges_.rows()), [&](const auto& visit) {
      for (Index t = 0; t < tets.rows(); ++t)
        for (const Index e : tet_edges_[t]) visit(e, t);
    });
  }

  void learn(Index e, Value value) {
    value_[e] = std::move(value);
    known_[e] = 1;
    queue_.push_back(e);
  }

  // Breadth-first spanning tree, its edges set to zero; returns all edges in the order they are
  // met.
  std::vector<Index> span() {
    const Index n = static_cast<Index>(first_.size()) - 1;
    const Incidence<> ends_at = corners_at(edges_, n);
    std::vector<char> seen(n, 0), listed(edges_.rows(), 0);
    std::vector<Index> vertices{edges_(0, 0)}, order;
    order.reserve(edges_.rows());
    seen[vertices[0]] = 1;
    for (std::size_t at = 0; at < vertices.size(); ++at) {
      const Index i = vertices[at];
      for (const Index end : ends_at[i]) {
        const Index e = end / 2;
        const Index j = edges_(e, 0) == i ? edges_(e, 1) : edges_(e, 0);
        if (!seen[j]) {
          seen[j] = 1;
          vertices.push_back(j);
          learn(e, {});
        }
        if (!listed[e]) order.push_back(e);
        listed[e] = 1;
      }
    }
    if (static_cast<Index>(order.size()) != edges_.rows()) {
      throw Error("ConnectivityError", "the tets are not connected; keep one component");
    }
    return order;
  }

  void propagate() {
    while (!queue_.empty()) {
      if (poll_ && ++work_ % 65536 == 0) poll_();
      const Index e = queue_.back();
      queue_.pop_back();
      for (const Index t : tets_at_[e]) complete(t);
    }
  }

  // Third sides of the faces of a tet that have two known ones.
  void complete(Index t) {
    constexpr Index sign[3] = {1, 1, -1};
    for (const auto& face : kFace) {
      int unknown = -1, count = 0;
      for (int k = 0; k < 3; ++k) {
        if (!known_[tet_edges_[t][face[k]]]) {
          unknown = k;
          ++count;
        }
      }
      if (count != 1) continue;
      Value sum;
      for (int k = 0; k < 3; ++k) {
        if (k != unknown) add(sum, value_[tet_edges_[t][face[k]]], -sign[unknown] * sign[k]);
      }
      learn(tet_edges_[t][face[unknown]], std::move(sum));
    }
  }

  const EdgesRef& edges_;
  const Poll& poll_;
  std::size_t work_ = 0;
  std::vector<Value> value_;
  std::vector<char> known_;
  std::vector<Index> first_;  // edges with lower id i are first_[i] .. first_[i + 1]
  std::vector<std::array<Index, 6>> tet_edges_;
  Incidence<> tets_at_;  // of each edge
  std::vector<Index> queue_;
  Index n_unknowns_ = 0;
};

}  // namespace

SolidCohomology solid_cohomology(const TetsRef& tets, const EdgesRef& edges, Index n_vertices,
                                 const std::vector<Loop>& loops, const Poll& poll) {
  Propagation forms(tets, edges, n_vertices, poll);
  forms.run();
  const std::set<Value> relations = forms.relations();
  SolidCohomology result;
  result.relations.setZero(relations.size(), forms.n_unknowns());
  Index row = 0;
  for (const Value& relation : relations) {
    for (const auto& [unknown, coefficient] : relation) {
      result.relations(row, unknown) = coefficient;
    }
    ++row;
  }
  result.loop_values.setZero(loops.size(), forms.n_unknowns());
  for (std::size_t l = 0; l < loops.size(); ++l) {
    for (std::size_t k = 0; k < loops[l].size(); ++k) {
      const Index i = loops[l][k], j = loops[l][(k + 1) % loops[l].size()];
      const Index e = forms.find_edge(i, j);
      if (e < 0) {
        throw Error("ArrayError",
                    "no edge of the solid joins " + std::to_string(i) + " and " + std::to_string(j),
                    {i, j});
      }
      for (const auto& [unknown, coefficient] : forms.value(e)) {
        result.loop_values(l, unknown) += i < j ? coefficient : -coefficient;
      }
    }
  }
  return result;
}

}  // namespace stretchmap::homology
