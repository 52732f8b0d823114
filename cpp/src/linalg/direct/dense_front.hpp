// The dense part of a multifrontal factorization: some unknowns of a symmetric front eliminated.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::linalg {

// A = [P; C' S] with the first `own` of `rows` columns in `panel` (column-major, rows long) and the
// rest in `schur` (column-major, rows - own long); of both the lower triangle is read and written.
// Afterwards the panel holds L below the diagonal and D on it, and schur is less L D L'. All
// processors and numbers of threads give the same bits.
// \return the first column whose pivot is zero or not finite, -1 if there is none.
Index eliminate_front(double* panel, double* schur, Index rows, Index own);

// Multiplications and additions of that.
double front_flops(double rows, double own);

}  // namespace stretchmap::linalg
