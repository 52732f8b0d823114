// The matrix of one level, as smoothing needs it: in single precision.
//
// Smoothing is a Gauss-Seidel sweep inside each of a fixed number of row chunks, all chunks at once
// (so the result does not depend on the number of threads). To let the sweeps run without a branch
// the entries of a row are stored in three groups: columns in other chunks, earlier columns of the
// same chunk, later columns of the same chunk; the diagonal is kept apart. What a forward sweep
// reads before and after it knows a row's result lies apart, too: sweeps are as fast as memory
// delivers. Blocks are B x B.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "stretchmap/linalg/pattern.hpp"

namespace stretchmap::linalg {

inline constexpr std::size_t kPadding = 3;  // numbers the sweeps may read beyond the last block

// Entries of all rows, one row after the other, in single precision.
struct SweepEntries {
  std::vector<Index> start;
  Buffer<Index> col;
  Buffer<float> value;  // column-major blocks, and kPadding more numbers
};

template <int B>
struct LevelMatrix {
  Index n = 0;                                      // block rows
  Index chunk = 0;                                  // block rows per chunk
  static constexpr Index kRows = kChunk / (B * B);  // at once, where chunks do not matter
  // Entries of row i: [start[i], lower[i]) other chunks, [lower[i], upper[i]) earlier columns,
  // [upper[i], start[i + 1]) later columns.
  std::vector<Index> start;
  Buffer<Index> lower, upper, col;
  Buffer<Index> source, diagonal_source;  // where the values come from, see set_values
  const double* values = nullptr;         // those, and what they are multiplied by
  double scale = 1.0;
  Buffer<double> diagonal;  // row-major blocks, multiplied
  // Earlier columns of the same chunk; all others, the later ones of row i from later[i] on.
  SweepEntries earlier, rest;
  Buffer<Index> later;
  Buffer<float> inverse_f;  // column-major; inverse of the (enlarged) diagonal
  // The diagonal is enlarged by 1 / (1 - excess) in rows whose couplings to other chunks would
  // otherwise make the simultaneous sweeps diverge; zero nearly everywhere.
  std::vector<float> excess;

  // The pattern holds the diagonal and is structurally symmetric. order[new] = old renumbers rows
  // and columns; empty: as it is.
  void set_pattern(Index rows, const Index* row_start, const Index* columns,
                   const std::vector<Index>& order);
  // From now on with the `given` values of the pattern's entries in its own order, row-major
  // blocks, times `factor`; they have to stay until the transfer to the next level has its numbers.
  // Returns the rows (at most 20) whose diagonal block is not positive definite; such a block is
  // replaced by one with the absolute values of its eigenvalues.
  std::vector<Index> set_values(const double* given, double factor = 1.0);
  // The block of entry e, row-major.
  std::array<double, B * B> block(Index e) const {
    std::array<double, B * B> out;
    const double* from = values + static_cast<std::size_t>(B * B) * source[e];
    for (int k = 0; k < B * B; ++k) out[k] = scale * from[k];
    return out;
  }

  // z = D^-1 r, K columns.
  template <int K>
  void divide_by_diagonal(const float* r, float* z) const;
  // x = M b with M one forward sweep from zero; r = b - A x.
  template <int K>
  void sweep_forward(const float* b, float* x, float* r) const;
  // x = y + M' (b - A y), one backward sweep.
  template <int K>
  void sweep_backward(const float* b, const float* y, float* x) const;
  // change = A x - b after that sweep, of its step x - y: what it left unbalanced, half the blocks.
  void unbalanced(const float* step, float* change) const;
  // y = D^-1 A x, one column.
  void scaled_multiply(const float* x, float* y) const;

 private:
  // visit(entries, position there, entry here) for the entries of row i.
  template <class Visit>
  void for_sweep_entries(Index i, const Visit& visit) {
    for (Index e = lower[i]; e < upper[i]; ++e) visit(earlier, earlier.start[i] + e - lower[i], e);
    for (Index e = start[i]; e < lower[i]; ++e) visit(rest, rest.start[i] + e - start[i], e);
    for (Index e = upper[i]; e < start[i + 1]; ++e) visit(rest, later[i] + e - upper[i], e);
  }
  void set_sweep_pattern();
  std::vector<Index> set_diagonals();
  void set_excess();
};

}  // namespace stretchmap::linalg
