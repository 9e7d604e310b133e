// Dense kernels on 48 x 48 column-major tiles: what the block Cholesky factorisation is made of. Included inside an
// instruction set's namespace.

#if PARALLAX_LANES == 8
inline constexpr int kPanelVectors = 3, kPanelColumns = 8;
#elif PARALLAX_LANES == 4
inline constexpr int kPanelVectors = 3, kPanelColumns = 4;
#else
inline constexpr int kPanelVectors = 2, kPanelColumns = 4;
#endif
inline constexpr int kPanelRows = kPanelVectors * kLanes;
static_assert(kTile % kPanelRows == 0 && kTile % kPanelColumns == 0);

// kPanelRows x kPanelColumns of C -= A B^T over `depth` columns of A and B.
PARALLAX_INLINE void multiply_panel(double* c, const double* a, const double* b, int depth) {
  Vec sum[kPanelColumns][kPanelVectors];
  for (int j = 0; j < kPanelColumns; ++j)
    for (int i = 0; i < kPanelVectors; ++i) sum[j][i] = load(c + j * kTile + i * kLanes);
  for (int k = 0; k < depth; ++k) {
    Vec column[kPanelVectors];
    for (int i = 0; i < kPanelVectors; ++i) column[i] = load(a + k * kTile + i * kLanes);
    for (int j = 0; j < kPanelColumns; ++j) {
      const Vec s = splat(b[k * kTile + j]);
      for (int i = 0; i < kPanelVectors; ++i) sum[j][i] = fnma(column[i], s, sum[j][i]);
    }
  }
  for (int j = 0; j < kPanelColumns; ++j)
    for (int i = 0; i < kPanelVectors; ++i) store(c + j * kTile + i * kLanes, sum[j][i]);
}

void tile_multiply(double* c, const double* a, const double* b) {
  for (int j = 0; j < kTile; j += kPanelColumns)
    for (int i = 0; i < kTile; i += kPanelRows) multiply_panel(c + j * kTile + i, a + i, b + j, kTile);
}

// Columns [j, j + kPanelColumns) of X times the inverse transpose of the panel's triangle l (its top left at l[0]).
PARALLAX_INLINE void solve_panel(double* x, const double* l, const double* inverse_diagonal) {
  for (int i = 0; i < kTile; i += kLanes) {
    Vec column[kPanelColumns];
    for (int j = 0; j < kPanelColumns; ++j) {
      Vec v = load(x + j * kTile + i);
      for (int k = 0; k < j; ++k) v = fnma(column[k], splat(l[k * kTile + j]), v);
      column[j] = v * inverse_diagonal[j];
      store(x + j * kTile + i, column[j]);
    }
  }
}

void tile_solve(double* x, const double* l) {
  for (int j = 0; j < kTile; j += kPanelColumns) {
    if (j > 0)
      for (int i = 0; i < kTile; i += kPanelRows) multiply_panel(x + j * kTile + i, x + i, l + j, j);
    double inverse[kPanelColumns];
    for (int k = 0; k < kPanelColumns; ++k) inverse[k] = 1.0 / l[(j + k) * kTile + j + k];
    solve_panel(x + j * kTile, l + j * kTile + j, inverse);
  }
}

// Above the diagonal the result is without meaning.
bool tile_factor(double* c) {
  for (int j = 0; j < kTile; j += kPanelColumns) {
    if (j > 0)
      for (int i = 0; i < kTile; i += kPanelRows) multiply_panel(c + j * kTile + i, c + i, c + j, j);
    double* d = c + j * kTile + j;
    double l[kPanelColumns * kTile], inverse[kPanelColumns];
    for (int a = 0; a < kPanelColumns; ++a) {
      for (int b = a; b < kPanelColumns; ++b) {
        double s = d[a * kTile + b];
        for (int k = 0; k < a; ++k) s -= l[k * kTile + a] * l[k * kTile + b];
        if (a == b) {
          // A pivot lost in the rounding of what it started from is no pivot.
          if (!(s > 0)) return false;
          const double root = std::sqrt(s);
          inverse[a] = 1.0 / root;
          l[a * kTile + a] = root;
        } else {
          l[a * kTile + b] = s * inverse[a];
        }
      }
    }
    solve_panel(c + j * kTile, l, inverse);
    for (int a = 0; a < kPanelColumns; ++a)
      for (int b = a; b < kPanelColumns; ++b) d[a * kTile + b] = l[a * kTile + b];
  }
  return true;
}

void tile_apply(double* y, const double* a, const double* x) {
  for (int i = 0; i < kTile; i += kPanelRows) {
    Vec sum[kPanelVectors];
    for (int v = 0; v < kPanelVectors; ++v) sum[v] = load(y + i + v * kLanes);
    for (int k = 0; k < kTile; ++k)
      for (int v = 0; v < kPanelVectors; ++v) sum[v] = fnma(load(a + k * kTile + i + v * kLanes), splat(x[k]), sum[v]);
    for (int v = 0; v < kPanelVectors; ++v) store(y + i + v * kLanes, sum[v]);
  }
}

void tile_apply_transposed(double* y, const double* a, const double* x) {
  for (int j = 0; j < kTile; j += 4) {
    Vec sum[4] = {};
    for (int i = 0; i < kTile; i += kLanes) {
      const Vec v = load(x + i);
      for (int k = 0; k < 4; ++k) sum[k] = fma(load(a + (j + k) * kTile + i), v, sum[k]);
    }
    for (int k = 0; k < 4; ++k) {
      double s = 0;
      for (int i = 0; i < kLanes; ++i) s += sum[k][i];
      y[j + k] -= s;
    }
  }
}
