#include "stretchmap/mesh/halved_faces.hpp"

#include <vector>

#include "stretchmap/base/errors.hpp"

namespace stretchmap::mesh {

namespace {

// With a face's edges 0, 1, 2 turned so that those halved come first, its parts in slots: whole,
// one, two and all edges halved. Of two, what the first part leaves is cut by either diagonal.
struct Parts {
  int count;
  int slots[4][3];
};
constexpr Parts kWhole = {1, {{0, 1, 2}}};
constexpr Parts kOne = {2, {{0, 3, 2}, {3, 1, 2}}};
constexpr Parts kToSecond = {3, {{3, 1, 4}, {0, 3, 4}, {0, 4, 2}}};
constexpr Parts kToFirst = {3, {{3, 1, 4}, {0, 3, 2}, {3, 4, 2}}};
constexpr Parts kAll = {4, {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}, {3, 4, 5}}};

Flags with_longest(const SurfaceTopology& top, Flags marked, const VecRef& lengths) {
  const Index m = static_cast<Index>(top.faces.rows());
  IndexVec longest(m);
  for (Index f = 0; f < m; ++f) {
    const auto edges = top.edge.segment<3>(3 * f);
    longest(f) = edges(0);
    for (int k = 1; k < 3; ++k)
      if (lengths(edges(k)) > lengths(longest(f))) longest(f) = edges(k);
  }
  std::vector<Index> open;  // faces that have got an edge
  const auto look_at = [&](Index f) {
    const auto edges = top.edge.segment<3>(3 * f);
    if (!(marked(edges(0)) || marked(edges(1)) || marked(edges(2)))) return;
    if (marked(longest(f))) return;
    marked(longest(f)) = 1;
    const Index h = top.edge_halfedge(longest(f)), twin = top.twin(h);
    open.push_back(h / 3);
    if (twin >= 0) open.push_back(twin / 3);
  };
  for (Index f = 0; f < m; ++f) {
    look_at(f);
    while (!open.empty()) {
      const Index next = open.back();
      open.pop_back();
      look_at(next);
    }
  }
  return marked;
}

}  // namespace

HalvedFaces halve_edges(const SurfaceTopology& top, const FlagsRef& marked, const VecRef& lengths) {
  const Index m = static_cast<Index>(top.faces.rows()), e = static_cast<Index>(top.edges.rows());
  if (marked.size() != e || lengths.size() != e)
    throw Error("ArrayError", "one flag and one length are needed for each edge");
  const Flags cut = with_longest(top, marked, lengths);
  HalvedFaces done;
  IndexVec midpoint = IndexVec::Constant(e, -1);
  Index n_cut = 0;
  for (Index i = 0; i < e; ++i)
    if (cut(i)) midpoint(i) = top.n_vertices + n_cut++;
  done.ends.resize(n_cut, 2);
  for (Index i = 0; i < e; ++i)
    if (cut(i)) done.ends.row(midpoint(i) - top.n_vertices) = top.edges.row(i);

  // One face more for each half-edge that is cut.
  Index more = 0;
  for (Index h = 0; h < top.edge.size(); ++h) more += cut(top.edge(h)) ? 1 : 0;
  done.faces.resize(m + more, 3);
  done.slots.resize(m + more, 3);
  done.parent.resize(m + more);
  Index next = 0;
  for (Index f = 0; f < m; ++f) {
    const auto edge = [&](int k) { return top.edge(3 * f + k % 3); };
    const auto halved = [&](int k) { return cut(edge(k)) != 0; };
    const int count = halved(0) + halved(1) + halved(2);
    int turn = 0;  // the corner that comes first
    const Parts* parts = count == 0 ? &kWhole : &kAll;
    if (count == 1) {
      while (!halved(turn)) ++turn;
      parts = &kOne;
    } else if (count == 2) {
      while (halved(turn)) ++turn;
      ++turn;  // the edge left whole comes last
      // Of two medians that to the longer side is the shorter.
      parts = lengths(edge(turn + 1)) > lengths(edge(turn)) ? &kToSecond : &kToFirst;
    }
    for (int part = 0; part < parts->count; ++part, ++next) {
      done.parent(next) = f;
      for (int c = 0; c < 3; ++c) {
        const int slot = parts->slots[part][c], k = (slot + turn) % 3;
        done.slots(next, c) = slot < 3 ? k : 3 + k;
        done.faces(next, c) = slot < 3 ? top.faces(f, k) : midpoint(edge(k));
      }
    }
  }
  return done;
}

}  // namespace stretchmap::mesh
