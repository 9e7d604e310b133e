// Partial Cholesky factorisation of a dense front. Included inside an instruction set's namespace, after
// simd_lanes.inl.

inline constexpr int kStripColumns = kLanes == 8 ? 8 : 4;
inline constexpr int kBlockColumns = 48;  // a block's columns stay in the second cache
inline constexpr double kNoPivot = 1e150;

// V vectors of rows and `width` columns of C -= A B^T over `depth` columns; B is read kStripColumns wide.
template <int V>
PARALLAX_INLINE void multiply_strip(double* c, int c_stride, const double* a, const double* b, int stride, int depth,
                                    int width) {
  Vec sum[kStripColumns][V];
  for (int j = 0; j < kStripColumns; ++j)
    for (int i = 0; i < V; ++i) sum[j][i] = j < width ? load(c + j * c_stride + i * kLanes) : Vec{};
  for (int k = 0; k < depth; ++k) {
    Vec column[V];
    for (int i = 0; i < V; ++i) column[i] = load(a + i * kLanes);
    for (int j = 0; j < kStripColumns; ++j) {
      const Vec s = splat(b[j]);
      for (int i = 0; i < V; ++i) sum[j][i] = fnma(column[i], s, sum[j][i]);
    }
    a += stride;
    b += stride;
  }
  for (int j = 0; j < width; ++j)
    for (int i = 0; i < V; ++i) store(c + j * c_stride + i * kLanes, sum[j][i]);
}

// `rows` (a multiple of kSparsePad) rows of a strip.
PARALLAX_INLINE void multiply_rows(double* c, int c_stride, const double* a, const double* b, int stride, int rows,
                                   int depth, int width) {
  int i = 0;
  for (; i + 2 * kLanes <= rows; i += 2 * kLanes) multiply_strip<2>(c + i, c_stride, a + i, b, stride, depth, width);
  for (; i < rows; i += kLanes) multiply_strip<1>(c + i, c_stride, a + i, b, stride, depth, width);
}

// Lower trapezoid of C (rows x columns, its diagonal at the top left) -= A A^T; C and A have their first rows in
// common.
void multiply_lower(double* c, int c_stride, const double* a, int stride, int rows, int columns, int depth) {
  for (int j = 0; j < columns; j += kStripColumns) {
    const int first = j / kSparsePad * kSparsePad, width = columns - j < kStripColumns ? columns - j : kStripColumns;
    multiply_rows(c + static_cast<long>(j) * c_stride + first, c_stride, a + first, a + j, stride, rows - first, depth,
                  width);
  }
}

// Factors a strip of `width` columns whose diagonal is at row `top` of the panel; what earlier columns owe is done.
PARALLAX_INLINE int factor_strip(double* strip, int top, int rows, int stride, int width) {
  double l[kStripColumns][kStripColumns] = {}, inverse[kStripColumns];
  int lost = 0;
  for (int j = 0; j < width; ++j)
    for (int i = j; i < width; ++i) {
      double s = strip[j * stride + top + i];
      for (int k = 0; k < j; ++k) s -= l[k][j] * l[k][i];
      if (i == j) {
        if (!(s > 0)) {
          s = kNoPivot;
          ++lost;
        }
        const double root = std::sqrt(s);
        inverse[j] = 1.0 / root;
        l[j][j] = root;
      } else {
        l[j][i] = s * inverse[j];
      }
    }
  for (int i = top / kSparsePad * kSparsePad; i < rows; i += kLanes) {
    Vec column[kStripColumns];
    for (int j = 0; j < width; ++j) {
      Vec v = load(strip + j * stride + i);
      for (int k = 0; k < j; ++k) v = fnma(column[k], splat(l[k][j]), v);
      column[j] = v * inverse[j];
      store(strip + j * stride + i, column[j]);
    }
  }
  for (int j = 0; j < width; ++j)
    for (int i = j; i < width; ++i) strip[j * stride + top + i] = l[j][i];
  return lost;
}

int factor_panel(double* panel, int rows, int columns, int stride) {
  const int padded = sparse_padded(rows);
  int lost = 0;
  for (int block = 0; block < columns; block += kBlockColumns) {
    const int end = block + kBlockColumns < columns ? block + kBlockColumns : columns;
    for (int j = block; j < end; j += kStripColumns) {
      const int width = end - j < kStripColumns ? end - j : kStripColumns, first = j / kSparsePad * kSparsePad;
      double* strip = panel + static_cast<long>(j) * stride;
      const double* done = panel + static_cast<long>(block) * stride;
      if (j > block)
        multiply_rows(strip + first, stride, done + first, done + j, stride, padded - first, j - block, width);
      lost += factor_strip(strip, j, padded, stride, width);
    }
    if (end < columns) {
      // kBlockColumns is a multiple of kSparsePad, so that the rest starts at a row of its own.
      double* rest = panel + static_cast<long>(end) * stride + end;
      multiply_lower(rest, stride, panel + static_cast<long>(block) * stride + end, stride, padded - end, columns - end,
                     end - block);
    }
  }
  return lost;
}

void reduce(double* u, int u_stride, const double* a, int a_stride, int n, int depth) {
  for (int k = 0; k < depth; k += 2 * kBlockColumns) {
    const int some = depth - k < 2 * kBlockColumns ? depth - k : 2 * kBlockColumns;
    multiply_lower(u, u_stride, a + static_cast<long>(k) * a_stride, a_stride, sparse_padded(n), n, some);
  }
}

PARALLAX_INLINE double sum_of(Vec v) {
  double s = 0;
  for (int i = 0; i < kLanes; ++i) s += v[i];
  return s;
}

void substitute(const double* panel, int rows, int columns, int stride, double* x) {
  // What is known first, four columns at a time; then the triangle.
  for (int j = 0; j < columns; j += 4) {
    const int width = columns - j < 4 ? columns - j : 4;
    const double* l = panel + static_cast<long>(j) * stride;
    Vec sum[4] = {};
    double rest[4] = {};
    int i = columns;
    if (width == 4)
      for (; i + kLanes <= rows; i += kLanes) {
        const Vec v = load(x + i);
        for (int k = 0; k < 4; ++k) sum[k] = fma(load(l + k * stride + i), v, sum[k]);
      }
    for (; i < rows; ++i)
      for (int k = 0; k < width; ++k) rest[k] += l[k * stride + i] * x[i];
    for (int k = 0; k < width; ++k) x[j + k] -= sum_of(sum[k]) + rest[k];
  }
  for (int j = columns - 1; j >= 0; --j) {
    const double* l = panel + static_cast<long>(j) * stride;
    Vec sum{};
    double s = x[j];
    int i = j + 1;
    for (; i + kLanes <= columns; i += kLanes) sum = fma(load(l + i), load(x + i), sum);
    for (; i < columns; ++i) s -= l[i] * x[i];
    x[j] = (s - sum_of(sum)) / l[j];
  }
}

extern const SparseKernels kernels;
const SparseKernels kernels{factor_panel, reduce, substitute};
