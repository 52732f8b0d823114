#include "stretchmap/volume/tet_plan.hpp"

#include <algorithm>
#include <array>

#include "stretchmap/base/incidence.hpp"
#include "stretchmap/base/parallel.hpp"
#include "volume/tet_weights.hpp"

namespace stretchmap::volume {
namespace {

using std::size_t;

// Position of the edge between two local corners among 01, 02, 03, 12, 13, 23.
constexpr int kEdge[4][4] = {{-1, 0, 1, 2}, {0, -1, 3, 4}, {1, 3, -1, 5}, {2, 4, 5, -1}};

// The mesh in internal numbering.
struct Numbered {
  Buffer<Index> order;      // internal vertex -> caller's
  Buffer<Index> tet;        // internal tet -> caller's
  Buffer<Index> corners;    // 4 per internal tet
  Buffer<Index> first_tet;  // per internal vertex, plus one: tets with a lower lowest vertex
  Buffer<Index> row;        // internal vertex -> row, -1 if prescribed
};

Numbered breadth_first(const TetsRef& tets, const FlagsRef& fixed) {
  const Index n = static_cast<Index>(fixed.size()), k = static_cast<Index>(tets.rows());
  const Incidence<> around = corners_at(tets, n);
  Numbered mesh;
  mesh.order.reserve(n);
  mesh.tet.reserve(k);
  mesh.first_tet.reserve(static_cast<size_t>(n) + 1);
  std::vector<Index> number(n, -1);
  std::vector<char> taken(k, 0);
  const auto reach = [&](Index v) {
    if (number[v] >= 0) return;
    number[v] = static_cast<Index>(mesh.order.size());
    mesh.order.push_back(v);
  };
  for (Index root = 0; root < n; ++root) {
    reach(root);
    for (size_t i = mesh.first_tet.size(); i < mesh.order.size(); ++i) {
      mesh.first_tet.push_back(static_cast<Index>(mesh.tet.size()));
      const Index v = mesh.order[i];
      for (const Index corner : around[v]) {
        const Index t = corner / 4;
        if (taken[t]) continue;
        taken[t] = 1;
        mesh.tet.push_back(t);
        for (int j = 0; j < 4; ++j) reach(tets(t, j));
      }
    }
  }
  mesh.first_tet.push_back(k);
  mesh.corners.resize(4 * size_t(k));
  for_rows(k, [&](Index t) {
    for (int j = 0; j < 4; ++j) mesh.corners[4 * size_t(t) + j] = number[tets(mesh.tet[t], j)];
  });
  mesh.row.resize(n);
  Index rows = 0;
  for (Index i = 0; i < n; ++i) mesh.row[i] = fixed[mesh.order[i]] ? -1 : rows++;
  return mesh;
}

// Vertices per chunk: as many chunks as leave no more than an eighth of the tets to be computed
// twice, judged by every 16th tet.
Index chunk_size(const Numbered& mesh) {
  const Index n = static_cast<Index>(mesh.order.size());
  for (const Index chunks : {64, 48, 32, 24, 16, 12, 8, 6, 4, 2}) {
    const Index size = (n + chunks - 1) / chunks;
    if (size < 1024) continue;
    size_t sampled = 0, again = 0;
    for (size_t i = 0; i < mesh.corners.size(); i += 64, ++sampled) {
      const auto [low, high] = std::minmax_element(&mesh.corners[i], &mesh.corners[i] + 4);
      again += *high / size - *low / size;
    }
    if (8 * again <= sampled) return size;
  }
  return std::max<Index>(n, 1);
}

class Builder {
 public:
  Builder(const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest)
      : mesh_(breadth_first(tets, fixed)),
        around_(corners_at(Eigen::Map<const Tets>(mesh_.corners.data(), tets.rows(), 4),
                           static_cast<Index>(fixed.size()))),
        n_(static_cast<Index>(fixed.size())),
        size_(chunk_size(mesh_)),
        chunks_(std::max<Index>(1, (n_ + size_ - 1) / size_)),
        rest_(rest) {}

  TetPlan build() {
    number_rows();
    find_neighbors();
    lay_out();
    fill_rows();
    fill_tets();
    plan_.order = std::move(mesh_.order);
    return std::move(plan_);
  }

 private:
  Index chunk_end(Index chunk) const { return std::min(n_, (chunk + 1) * size_); }
  // Whether the edge between free internal vertex v and neighbor j is summed by v.
  bool owns(Index v, Index j) const { return j > v || mesh_.row[j] < 0; }

  template <class Visit>
  void each_chunk(const Visit& visit) {
    for_tasks(chunks_, [&](Index chunk) { visit(chunk); });
  }
  // visit(vertex, row) for the free vertices of a chunk
  template <class Visit>
  void each_row(Index chunk, const Visit& visit) const {
    for (Index v = chunk * size_; v < chunk_end(chunk); ++v)
      if (mesh_.row[v] >= 0) visit(v, mesh_.row[v]);
  }

  void number_rows();
  void find_neighbors();
  void lay_out();
  void fill_rows();
  void fill_tets();
  void fill_chunk(Index chunk, const std::vector<Index>& seam);
  std::vector<Index> seam_tets(Index chunk) const;

  Numbered mesh_;
  Incidence<> around_;  // corners
  Index n_, size_, chunks_;
  const VecRef& rest_;
  TetPlan plan_;
  std::vector<Index> upper_, couples_;         // per row, how many
  std::vector<std::vector<Index>> neighbors_;  // per chunk, row by row: higher free ones,
                                               // ascending, then prescribed ones, ascending
};

void Builder::number_rows() {
  std::vector<Index> interior;
  for (Index v = 0; v < n_; ++v)
    if (mesh_.row[v] >= 0) interior.push_back(mesh_.order[v]);
  plan_.interior =
      Eigen::Map<const IndexVec>(interior.data(), static_cast<Eigen::Index>(interior.size()));
  upper_.assign(interior.size(), 0);
  couples_.assign(interior.size(), 0);
  neighbors_.resize(chunks_);
}

void Builder::find_neighbors() {
  each_chunk([&](Index chunk) {
    std::vector<Index> seen(n_, -1), upper, fixed;
    std::vector<Index>& out = neighbors_[chunk];
    each_row(chunk, [&](Index v, Index r) {
      upper.clear();
      fixed.clear();
      for (const Index at : around_[v]) {
        const Index* corner = &mesh_.corners[4 * size_t(at / 4)];
        for (int j = 0; j < 4; ++j) {
          const Index w = corner[j];
          if (w == v || !owns(v, w) || seen[w] == v) continue;
          seen[w] = v;
          (mesh_.row[w] < 0 ? fixed : upper).push_back(w);
        }
      }
      std::sort(upper.begin(), upper.end());
      std::sort(fixed.begin(), fixed.end());
      upper_[r] = static_cast<Index>(upper.size());
      couples_[r] = static_cast<Index>(fixed.size());
      out.insert(out.end(), upper.begin(), upper.end());
      out.insert(out.end(), fixed.begin(), fixed.end());
    });
  });
}

// Sizes and starts of everything that is kept per row.
void Builder::lay_out() {
  const Index rows = plan_.rows();
  plan_.lower_start.assign(static_cast<size_t>(rows) + 1, 0);
  for (Index chunk = 0; chunk < chunks_; ++chunk) {
    const Index* neighbor = neighbors_[chunk].data();
    each_row(chunk, [&](Index, Index r) {
      for (Index i = 0; i < upper_[r]; ++i) ++plan_.lower_start[mesh_.row[neighbor[i]] + 1];
      neighbor += upper_[r] + couples_[r];
    });
  }
  plan_.outer.assign(static_cast<size_t>(rows) + 1, 0);
  plan_.couple_start.assign(static_cast<size_t>(rows) + 1, 0);
  for (Index r = 0; r < rows; ++r) {
    plan_.outer[r + 1] = plan_.outer[r] + plan_.lower_start[r + 1] + 1 + upper_[r];
    plan_.lower_start[r + 1] += plan_.lower_start[r];
    plan_.couple_start[r + 1] = plan_.couple_start[r] + couples_[r];
  }
  plan_.row_slot.resize(rows);
  plan_.chunk_slot.assign(1, 0);
  Index slot = 0;
  for (Index chunk = 0; chunk < chunks_; ++chunk) {
    each_row(chunk, [&](Index, Index r) {
      plan_.row_slot[r] = slot;
      slot += upper_[r] + couples_[r];
    });
    plan_.chunk_slot.push_back(++slot);  // one for the weights nobody reads
  }
}

// Rows in ascending order enter themselves before the diagonal of their higher neighbors, so that
// columns ascend.
void Builder::fill_rows() {
  plan_.inner.resize(plan_.outer.back());
  plan_.lower_slot.resize(plan_.lower_start.back());
  plan_.couple_vertex.resize(plan_.couple_start.back());
  std::vector<Index> count(upper_.size(), 0);  // entries before the diagonal so far
  for (Index chunk = 0; chunk < chunks_; ++chunk) {
    const Index* neighbor = neighbors_[chunk].data();
    each_row(chunk, [&](Index, Index r) {
      Index* after = plan_.inner.data() + plan_.outer[r + 1] - upper_[r];
      after[-1] = r;
      for (Index i = 0; i < upper_[r]; ++i) {
        const Index column = after[i] = mesh_.row[*neighbor++];
        plan_.inner[plan_.outer[column] + count[column]] = r;
        plan_.lower_slot[plan_.lower_start[column] + count[column]++] = plan_.row_slot[r] + i;
      }
      for (Index i = 0; i < couples_[r]; ++i)
        plan_.couple_vertex[plan_.couple_start[r] + i] = mesh_.order[*neighbor++];
    });
  }
}

// Tets with their lowest vertex in an earlier chunk and an edge that this one sums.
std::vector<Index> Builder::seam_tets(Index chunk) const {
  std::vector<Index> seam;
  const Index own = mesh_.first_tet[chunk * size_];
  each_row(chunk, [&](Index v, Index) {
    for (const Index at : around_[v]) {
      if (at / 4 >= own) break;
      const Index* corner = &mesh_.corners[4 * size_t(at / 4)];
      if (std::any_of(corner, corner + 4, [&](Index w) { return w != v && owns(v, w); }))
        seam.push_back(at / 4);
    }
  });
  std::sort(seam.begin(), seam.end());
  seam.erase(std::unique(seam.begin(), seam.end()), seam.end());
  return seam;
}

void Builder::fill_tets() {
  std::vector<std::vector<Index>> seam(chunks_);
  each_chunk([&](Index chunk) { seam[chunk] = seam_tets(chunk); });
  plan_.chunk_tet.assign(1, 0);
  for (Index chunk = 0; chunk < chunks_; ++chunk) {
    const std::int64_t count = static_cast<std::int64_t>(seam[chunk].size()) +
                               mesh_.first_tet[chunk_end(chunk)] - mesh_.first_tet[chunk * size_];
    plan_.chunk_tet.push_back(plan_.chunk_tet.back() +
                              (count + kTetGroup - 1) / kTetGroup * kTetGroup);
  }
  const auto total = static_cast<size_t>(plan_.chunk_tet.back());
  plan_.corners.resize(4 * total);
  plan_.rest.resize(total);
  plan_.slots.resize(6 * total);
  each_chunk([&](Index chunk) { fill_chunk(chunk, seam[chunk]); });
}

void Builder::fill_chunk(Index chunk, const std::vector<Index>& seam) {
  const Index own = mesh_.first_tet[chunk * size_], unread = plan_.chunk_slot[chunk + 1] - 1;
  const std::int64_t first = plan_.chunk_tet[chunk], last = plan_.chunk_tet[chunk + 1];
  const auto n_seam = static_cast<std::int64_t>(seam.size());
  const std::int64_t own_end = first + n_seam + mesh_.first_tet[chunk_end(chunk)] - own;
  for (std::int64_t at = first; at < last; ++at) {
    // What fills the last group repeats a tet; its weights go where nobody reads them.
    const std::int64_t from = std::min(at, own_end - 1) - first;
    const Index t = from < n_seam ? seam[from] : static_cast<Index>(own + from - n_seam);
    std::copy_n(&mesh_.corners[4 * size_t(t)], 4, &plan_.corners[4 * size_t(at)]);
    plan_.rest[at] = rest_[mesh_.tet[t]];
    std::fill_n(&plan_.slots[6 * size_t(at)], 6, unread);
  }
  std::vector<Index> slot_of(n_);
  const Index* neighbor = neighbors_[chunk].data();
  each_row(chunk, [&](Index v, Index r) {
    for (Index i = 0; i < upper_[r] + couples_[r]; ++i)
      slot_of[*neighbor++] = plan_.row_slot[r] + i;
    for (const Index position : around_[v]) {
      const Index t = position / 4, here = position % 4;
      const Index* corner = &mesh_.corners[4 * size_t(t)];
      std::int64_t at = -1;
      for (int j = 0; j < 4; ++j) {
        if (j == here || !owns(v, corner[j])) continue;
        if (at < 0)
          at = first + (t >= own ? n_seam + t - own
                                 : std::lower_bound(seam.begin(), seam.end(), t) - seam.begin());
        plan_.slots[6 * size_t(at) + kEdge[here][j]] = slot_of[corner[j]];
      }
    }
  });
}

}  // namespace

double TetPlan::index_bytes() const {
  double count = 0.0;
  for (const auto* starts : {&outer, &lower_start, &couple_start})
    count += static_cast<double>(starts->size());
  for (const auto* indices : {&order, &slots, &lower_slot, &row_slot, &couple_vertex})
    count += static_cast<double>(indices->size());
  return sizeof(Index) * count;
}

TetPlan make_tet_plan(const TetsRef& tets, const FlagsRef& fixed, const VecRef& rest) {
  return Builder(tets, fixed, rest).build();
}

}  // namespace stretchmap::volume
