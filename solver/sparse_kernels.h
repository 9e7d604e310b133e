// The dense inner loops of sparse elimination, compiled once for each instruction set and chosen at run time
// (core/cpu_dispatch.h). Plain column-major arrays; nothing here allocates, waits or throws. Internal to solver/.
//
// Arrays start at multiples of 64 bytes and have their leading dimension rounded up to kSparsePad; the rows that this
// adds hold zeros.
#pragma once

namespace parallax::solver {

inline constexpr int kSparsePad = 8;
inline constexpr int sparse_padded(int rows) { return (rows + kSparsePad - 1) / kSparsePad * kSparsePad; }

struct SparseKernels {
  // The first `columns` columns of a symmetric front of `rows` rows, lower triangle, become those of its Cholesky
  // factor. A pivot that is not positive counts as infinite (its unknown stays at zero). Returns how many were not.
  int (*factor_panel)(double* panel, int rows, int columns, int stride);
  // Lower triangle of U -= A A^T, A n x depth. What is above the diagonal of U is without meaning.
  void (*reduce)(double* u, int u_stride, const double* a, int a_stride, int n, int depth);
  // L^T x = b for the panel's columns: x holds b for these first, and the known values of the other rows after them.
  void (*substitute)(const double* panel, int rows, int columns, int stride, double* x);
};

// At the level in use.
const SparseKernels& sparse_kernels();

}  // namespace parallax::solver
