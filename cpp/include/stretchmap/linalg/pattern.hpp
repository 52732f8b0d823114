// Sparsity patterns.
#pragma once

#include <cstddef>
#include <vector>

#include "stretchmap/base/parallel.hpp"

namespace stretchmap::linalg {

// Compressed rows without values.
struct Pattern {
  Index columns = 0;
  std::vector<Index> start{0};  // (rows + 1)
  Buffer<Index> col;

  Index rows() const { return static_cast<Index>(start.size()) - 1; }
};

// The distinct columns of one row, ascending.
class RowSet {
 public:
  explicit RowSet(Index columns) : seen_(static_cast<std::size_t>(columns), -1) {}
  void begin(Index row) {
    row_ = row;
    members.clear();
  }
  void add(Index column) {
    if (seen_[column] == row_) return;
    seen_[column] = row_;
    members.push_back(column);
  }
  std::vector<Index> members;

 private:
  std::vector<Index> seen_;
  Index row_ = -1;
};

// Rows of a pattern, collect(row, set) adding the columns of each.
template <class Collect>
Pattern build_pattern(Index rows, Index columns, const Collect& collect) {
  const Index chunks = chunk_count(rows, kElementChunk);
  std::vector<std::vector<Index>> parts(static_cast<std::size_t>(chunks));
  Pattern pattern;
  pattern.columns = columns;
  pattern.start.assign(static_cast<std::size_t>(rows) + 1, 0);
  for_chunks_with(
      rows, kElementChunk, [&] { return RowSet(columns); },
      [&](Index begin, Index end, RowSet& set) {
        std::vector<Index>& part = parts[begin / kElementChunk];
        for (Index i = begin; i < end; ++i) {
          set.begin(i);
          collect(i, set);
          std::sort(set.members.begin(), set.members.end());
          part.insert(part.end(), set.members.begin(), set.members.end());
          pattern.start[i + 1] = static_cast<Index>(set.members.size());
        }
      });
  for (Index i = 0; i < rows; ++i) pattern.start[i + 1] += pattern.start[i];
  pattern.col = joined(parts);
  return pattern;
}

}  // namespace stretchmap::linalg
