// The two passes over the observations of a bundle adjustment iteration. Included inside an instruction set's
// namespace.

// Square root of the IRLS weight, from the squared normalised residual.
PARALLAX_INLINE Vec root_weight(KernelParameters kernel, Vec squared) {
  if (kernel.kind == 2) return maximum(1.0 - squared / kernel.c2, Vec{});
  if (kernel.kind == 1) {
    const Vec x = squared / kernel.c2;
    return select(x <= 1.0, splat(1.0), square_root(1.0 / square_root(maximum(x, splat(1.0)))));
  }
  return splat(1.0);
}

// A lane of observations at some state.
template <Lens kLens>
struct ObservationLanes {
  Vec R[9], P[3];
  Projection projection;
  Vec ru, rv, squared;  // normalised residual; garbage where not valid
  Vec inverse_sigma;
  Mask valid;  // in the domain and taking part

  PARALLAX_INLINE void evaluate(const LensParameters& lens, const ObservationArrays& o, const double* cameras,
                                const double* points, int i) {
    const std::int32_t *c = o.camera + i, *p = o.point + i;
    for (int k = 0; k < 9; ++k) R[k] = gather(cameras + k, c);
    const Vec x = gather(points, p), y = gather(points + 1, p), z = gather(points + 2, p);
    for (int k = 0; k < 3; ++k)
      P[k] = fma(R[3 * k], x, fma(R[3 * k + 1], y, fma(R[3 * k + 2], z, gather(cameras + 9 + k, c))));
    Vec intrinsics[3] = {};
    if constexpr (kLens == Lens::bal)
      for (int k = 0; k < 3; ++k) intrinsics[k] = gather(cameras + 12 + k, c);
    LensLanes<kLens>::project(lens, P[0], P[1], P[2], intrinsics, &projection);
    inverse_sigma = load(o.inverse_sigma + i);
    ru = (projection.u - load(o.u + i)) * inverse_sigma;
    rv = (projection.v - load(o.v + i)) * inverse_sigma;
    squared = fma(ru, ru, rv * rv);
    valid = projection.valid & (inverse_sigma > 0.0);
  }

  // Infinite outside the domain, -1 for what takes no part.
  PARALLAX_INLINE Vec reported_squared() const {
    const Vec s = select(projection.valid & (squared < 1e300), squared, splat(1e300 * 1e10));
    return select(inverse_sigma > 0.0, s, splat(-1.0));
  }

  // Scales residual and Jacobian by the root of the weight and 1 / sigma; zero where not valid.
  PARALLAX_INLINE void weigh(KernelParameters kernel) {
    const Vec w = root_weight(kernel, squared), g = w * inverse_sigma;
    const Mask use = valid & (w > 0.0);
    ru = select(use, ru * w, Vec{});
    rv = select(use, rv * w, Vec{});
    for (Vec& j : projection.j) j = select(use, j * g, Vec{});
    if constexpr (kLens == Lens::bal)
      for (Vec& j : projection.extra) j = select(use, j * g, Vec{});
  }
};

// Writes kLanes records of `kValues` values, each record contiguous, from values in lanes.
template <int kValues>
PARALLAX_INLINE void store_records(const Vec* value, double* record) {
#if PARALLAX_LANES == 8
  static_assert(kValues % 8 == 0);
  for (int k = 0; k < kValues; k += 8) {
    __m512d a[8], b[8];
    for (int i = 0; i < 8; i += 2) {
      a[i] = _mm512_unpacklo_pd(__m512d(value[k + i]), __m512d(value[k + i + 1]));
      a[i + 1] = _mm512_unpackhi_pd(__m512d(value[k + i]), __m512d(value[k + i + 1]));
    }
    for (int i = 0; i < 8; i += 4)
      for (int j = 0; j < 2; ++j) {
        b[i + j] = _mm512_shuffle_f64x2(a[i + j], a[i + j + 2], 0x88);
        b[i + j + 2] = _mm512_shuffle_f64x2(a[i + j], a[i + j + 2], 0xdd);
      }
    // b[0]: lanes 0, 4 of values 0..3; b[1]: lanes 1, 5; b[2]: lanes 2, 6; b[3]: lanes 3, 7; b[4..7]: of values 4..7.
    for (int i = 0; i < 4; ++i) {
      // Quarter order of b is (v01 l, v01 l+4, v23 l, v23 l+4).
      const __m512d low = _mm512_shuffle_f64x2(b[i], b[i + 4], 0x88), high = _mm512_shuffle_f64x2(b[i], b[i + 4], 0xdd);
      _mm512_storeu_pd(record + i * kValues + k, low);
      _mm512_storeu_pd(record + (i + 4) * kValues + k, high);
    }
  }
#else
  for (int k = 0; k < kValues; ++k)
    for (int i = 0; i < kLanes; ++i) record[i * kValues + k] = value[k][i];
#endif
}

template <int D>
inline constexpr int kFreeRecord = D == 6 ? 24 : 32;
inline constexpr int kFixedRecord = 8;

// Jacobian of the pixel by the world point.
template <class Lanes>
PARALLAX_INLINE void point_jacobian(const Lanes& o, Vec* out) {
  const Vec* j = o.projection.j;
  for (int row = 0; row < 2; ++row)
    for (int k = 0; k < 3; ++k)
      out[3 * row + k] = fma(j[3 * row], o.R[k], fma(j[3 * row + 1], o.R[3 + k], j[3 * row + 2] * o.R[6 + k]));
}

// Records of free observations: camera Jacobian (2 x D), point Jacobian (2 x 3), residual.
template <Lens kLens>
void free_records(const LineariseJob& job, int first, int last, double* record) {
  constexpr int D = LensLanes<kLens>::kCamera;
  for (int i = first; i < last; i += kLanes, record += kLanes * kFreeRecord<D>) {
    ObservationLanes<kLens> o;
    o.evaluate(job.lens, job.free, job.cameras, job.points, i);
    o.weigh(job.kernel);
    Vec value[kFreeRecord<D>] = {};
    for (int row = 0; row < 2; ++row) {
      const Vec *j = o.projection.j + 3 * row, *P = o.P;
      Vec* out = value + D * row;
      for (int k = 0; k < 3; ++k) out[k] = j[k];
      out[3] = P[1] * j[2] - P[2] * j[1];
      out[4] = P[2] * j[0] - P[0] * j[2];
      out[5] = P[0] * j[1] - P[1] * j[0];
      if constexpr (D == 9)
        for (int k = 0; k < 3; ++k) out[6 + k] = o.projection.extra[3 * row + k];
    }
    point_jacobian(o, value + 2 * D);
    value[2 * D + 6] = o.ru;
    value[2 * D + 7] = o.rv;
    store_records<kFreeRecord<D>>(value, record);
  }
}

// Records of fixed observations: point Jacobian, residual.
template <Lens kLens>
void fixed_records(const LineariseJob& job, int first, int last, double* record) {
  for (int i = first; i < last; i += kLanes, record += kLanes * kFixedRecord) {
    ObservationLanes<kLens> o;
    o.evaluate(job.lens, job.fixed, job.cameras, job.points, i);
    o.weigh(job.kernel);
    Vec value[kFixedRecord];
    point_jacobian(o, value);
    value[6] = o.ru;
    value[7] = o.rv;
    store_records<kFixedRecord>(value, record);
  }
}

// The 3x3 normal matrix of a point by rows (the fourth element of each is without meaning) and its gradient.
struct PointBlock {
  Vec4 row[3] = {}, gradient = {};

  // `j`: the 2x3 Jacobian and the residual, eight doubles.
  PARALLAX_INLINE void add(const double* j) {
    const Vec4 a = *reinterpret_cast<const Vec4Unaligned*>(j), b = *reinterpret_cast<const Vec4Unaligned*>(j + 3);
    for (int k = 0; k < 3; ++k) {
      add_product(row[k], j[k], a);
      add_product(row[k], j[3 + k], b);
    }
    add_product(gradient, j[6], a);
    add_product(gradient, j[7], b);
  }

  // Damps, factors, and keeps the inverse factor, gradient and diagonal. A point without a usable factor stays put.
  PARALLAX_INLINE void finish(double lambda, double* out) const {
    double d[3], m[3];
    for (int k = 0; k < 3; ++k) {
      d[k] = row[k][k] < 1e-6 ? 1e-6 : row[k][k];
      m[k] = row[k][k] + lambda * d[k];
      out[6 + k] = gradient[k];
      out[9 + k] = d[k];
    }
    constexpr double kSmallestPivot = 1e-14;  // of the diagonal
    for (int k = 0; k < 6; ++k) out[k] = 0;
    if (!(row[0][0] > 0) || !(row[1][1] > 0) || !(row[2][2] > 0)) return;
    const double i0 = 1.0 / std::sqrt(m[0]);
    const double l10 = row[1][0] * i0, l20 = row[2][0] * i0;
    const double p1 = m[1] - l10 * l10;
    if (!(p1 > kSmallestPivot * m[1])) return;
    const double i1 = 1.0 / std::sqrt(p1);
    const double l21 = (row[2][1] - l20 * l10) * i1;
    const double p2 = m[2] - l20 * l20 - l21 * l21;
    if (!(p2 > kSmallestPivot * m[2])) return;
    const double i2 = 1.0 / std::sqrt(p2);
    out[0] = i0;
    out[2] = i1;
    out[5] = i2;
    out[1] = -l10 * i0 * i1;
    out[4] = -l21 * i1 * i2;
    out[3] = -(l20 * i0 + l21 * out[1]) * i2;
  }
};

template <int D>
inline constexpr int kEliminationStride = 3 * D + 3;  // rows of L^-1 W^T, padded so that 4-wide loads stay inside

// Adds one point's share of the reduced system: diagonal blocks U - T^T T, off-diagonal ones -T_i^T T_j.
template <int D>
PARALLAX_INLINE void eliminate_point(const LineariseJob& job, const std::int32_t* camera, int count,
                                     const double* record, const double* data, double* T) {
  const double l00 = data[0], l10 = data[1], l11 = data[2], l20 = data[3], l21 = data[4], l22 = data[5];
  const double z0 = l00 * data[6], z1 = l10 * data[6] + l11 * data[7],
               z2 = l20 * data[6] + l21 * data[7] + l22 * data[8];
  for (int i = 0; i < count; ++i) {
    const double* r = record + i * kFreeRecord<D>;
    double* t = T + i * kEliminationStride<D>;
    const Row<D> j0 = Row<D>::load(r), j1 = Row<D>::load(r + D);
    const double *a = r + 2 * D, *b = a + 3;
    Row<D> t0 = Row<D>::zero(), t1 = Row<D>::zero(), t2 = Row<D>::zero();
    t0.add(l00 * a[0], j0);
    t0.add(l00 * b[0], j1);
    t1.add(l10 * a[0] + l11 * a[1], j0);
    t1.add(l10 * b[0] + l11 * b[1], j1);
    t2.add(l20 * a[0] + l21 * a[1] + l22 * a[2], j0);
    t2.add(l20 * b[0] + l21 * b[1] + l22 * b[2], j1);
    t0.store(t);
    t1.store(t + D);
    t2.store(t + 2 * D);
    const int c = camera[i] / kCameraStride, tile = job.tile_of[c], local = job.local_of[c];
    double* block =
        job.tiles + job.tile_at[static_cast<std::int64_t>(tile) * job.tile_count + tile] + local * kTile + local;
    for (int k = 0; k < D; ++k) {
      Row<D> s = Row<D>::load(block + k * kTile);
      s.add(r[k], j0);
      s.add(r[D + k], j1);
      s.subtract(t[k], t0);
      s.subtract(t[D + k], t1);
      s.subtract(t[2 * D + k], t2);
      s.store(block + k * kTile);
    }
    double *right = job.right + tile * kTile + local, *diagonal = job.camera_diagonal + tile * kTile + local;
    Row<D> s = Row<D>::load(right);
    s.subtract(r[2 * D + 6], j0);
    s.subtract(r[2 * D + 7], j1);
    s.add(z0, t0);
    s.add(z1, t1);
    s.add(z2, t2);
    s.store(right);
    s = Row<D>::load(diagonal);
    s.add_square(j0);
    s.add_square(j1);
    s.store(diagonal);
  }
  for (int i = 1; i < count; ++i) {  // rows; columns are cameras eliminated before
    const double* ti = T + i * kEliminationStride<D>;
    const Row<D> t0 = Row<D>::load(ti), t1 = Row<D>::load(ti + D), t2 = Row<D>::load(ti + 2 * D);
    const int ci = camera[i] / kCameraStride;
    const std::int64_t* tile_at = job.tile_at + static_cast<std::int64_t>(job.tile_of[ci]) * job.tile_count;
    double* base = job.tiles + job.local_of[ci];
    for (int j = 0; j < i; ++j) {
      const double* tj = T + j * kEliminationStride<D>;
      const int cj = camera[j] / kCameraStride;
      double* block = base + tile_at[job.tile_of[cj]] + job.local_of[cj] * kTile;
      for (int k = 0; k < D; ++k) {
        Row<D> s = Row<D>::load(block + k * kTile);
        s.subtract(tj[k], t0);
        s.subtract(tj[D + k], t1);
        s.subtract(tj[2 * D + k], t2);
        s.store(block + k * kTile);
      }
      if (ci == cj) {  // one camera saw the point twice: both orders fall on the diagonal block
        const Row<D> u0 = Row<D>::load(tj), u1 = Row<D>::load(tj + D), u2 = Row<D>::load(tj + 2 * D);
        for (int k = 0; k < D; ++k) {
          Row<D> s = Row<D>::load(block + k * kTile);
          s.subtract(ti[k], u0);
          s.subtract(ti[D + k], u1);
          s.subtract(ti[2 * D + k], u2);
          s.store(block + k * kTile);
        }
      }
    }
  }
}

template <Lens kLens>
void linearise(const LineariseJob& job, int first, int last) {
  constexpr int D = LensLanes<kLens>::kCamera;
  const int free_first = job.free.begin[first], free_last = job.free.begin[last];
  const int fixed_first = job.fixed.begin[first], fixed_last = job.fixed.begin[last];
  double* free_record = job.scratch;
  double* fixed_record = free_record + (free_last - free_first + kLanePadding) * kFreeRecord<D>;
  double* T = fixed_record + (fixed_last - fixed_first + kLanePadding) * kFixedRecord;
  free_records<kLens>(job, free_first, free_last, free_record);
  fixed_records<kLens>(job, fixed_first, fixed_last, fixed_record);
  for (int p = first; p < last; ++p) {
    const int count = job.free.begin[p + 1] - job.free.begin[p];
    const int fixed_count = job.fixed.begin[p + 1] - job.fixed.begin[p];
    const double* record = free_record + (job.free.begin[p] - free_first) * kFreeRecord<D>;
    const double* fixed = fixed_record + (job.fixed.begin[p] - fixed_first) * kFixedRecord;
    PointBlock block;
    for (int i = 0; i < count; ++i) block.add(record + i * kFreeRecord<D> + 2 * D);
    for (int i = 0; i < fixed_count; ++i) block.add(fixed + i * kFixedRecord);
    double* data = job.point_data + static_cast<std::int64_t>(p) * kPointStride;
    block.finish(job.lambda, data);
    eliminate_point<D>(job, job.free.camera + job.free.begin[p], count, record, data, T);
  }
}

// Squared residuals of observations [first, last) at the given state.
template <Lens kLens>
PARALLAX_INLINE void squared_residuals(const LensParameters& lens, const ObservationArrays& arrays,
                                       const double* cameras, const double* points, int first, int last, double* out) {
  for (int i = first; i < last; i += kLanes) {
    ObservationLanes<kLens> o;
    o.evaluate(lens, arrays, cameras, points, i);
    const Vec s = o.reported_squared();
    if (i + kLanes <= last) {
      store(out + i, s);
    } else {
      for (int k = 0; i + k < last; ++k) out[i + k] = s[k];
    }
  }
}

template <Lens kLens>
void evaluate(UpdateJob& job, int first, int last) {
  squared_residuals<kLens>(job.lens, job.free, job.new_cameras, job.new_points, job.free.begin[first],
                           job.free.begin[last], job.free_squared);
  squared_residuals<kLens>(job.lens, job.fixed, job.new_cameras, job.new_points, job.fixed.begin[first],
                           job.fixed.begin[last], job.fixed_squared);
}

template <Lens kLens>
void update(UpdateJob& job, int first, int last) {
  const int free_first = job.free.begin[first], free_last = job.free.begin[last];
  const int stride = free_last - free_first + kLanePadding;
  double* pull = job.scratch;  // J_x^T J_c dc, three arrays
  for (int i = free_first; i < free_last; i += kLanes) {
    ObservationLanes<kLens> o;
    o.evaluate(job.lens, job.free, job.cameras, job.points, i);
    o.weigh(job.kernel);
    const std::int32_t* c = job.free.camera + i;
    Vec d[6];
    for (int k = 0; k < 6; ++k) d[k] = gather(job.step + k, c);
    const Vec* P = o.P;
    const Vec dx = d[0] + d[4] * P[2] - d[5] * P[1], dy = d[1] + d[5] * P[0] - d[3] * P[2],
              dz = d[2] + d[3] * P[1] - d[4] * P[0];
    const Vec* j = o.projection.j;
    Vec e0 = fma(j[0], dx, fma(j[1], dy, j[2] * dz)), e1 = fma(j[3], dx, fma(j[4], dy, j[5] * dz));
    if constexpr (kLens == Lens::bal)
      for (int k = 0; k < 3; ++k) {
        const Vec dk = gather(job.step + 6 + k, c);
        e0 = fma(o.projection.extra[k], dk, e0);
        e1 = fma(o.projection.extra[3 + k], dk, e1);
      }
    Vec y[3];
    for (int k = 0; k < 3; ++k) y[k] = fma(j[k], e0, j[3 + k] * e1);
    for (int k = 0; k < 3; ++k)
      store(pull + k * stride + i - free_first, fma(o.R[k], y[0], fma(o.R[3 + k], y[1], o.R[6 + k] * y[2])));
  }
  for (int p = first; p < last; ++p) {
    const double* data = job.point_data + static_cast<std::int64_t>(p) * kPointStride;
    double b[3] = {data[6], data[7], data[8]};
    const double z0 = data[0] * b[0], z1 = data[1] * b[0] + data[2] * b[1],
                 z2 = data[3] * b[0] + data[4] * b[1] + data[5] * b[2];
    job.predicted += z0 * z0 + z1 * z1 + z2 * z2;
    for (int i = job.free.begin[p] - free_first; i < job.free.begin[p + 1] - free_first; ++i)
      for (int k = 0; k < 3; ++k) b[k] += pull[k * stride + i];
    const double t0 = data[0] * b[0], t1 = data[1] * b[0] + data[2] * b[1],
                 t2 = data[3] * b[0] + data[4] * b[1] + data[5] * b[2];
    const double step[3] = {-(data[0] * t0 + data[1] * t1 + data[3] * t2), -(data[2] * t1 + data[4] * t2),
                            -(data[5] * t2)};
    for (int k = 0; k < 3; ++k) {
      job.new_points[3 * p + k] = job.points[3 * p + k] + step[k];
      job.predicted += job.lambda * data[9 + k] * step[k] * step[k];
      const double size = step[k] < 0 ? -step[k] : step[k];
      job.largest = size > job.largest ? size : job.largest;
    }
  }
  evaluate<kLens>(job, first, last);
}

PARALLAX_INLINE Vec cost_lanes(KernelParameters kernel, Vec squared) {
  const Vec x = squared / kernel.c2;
  Vec rho = x;
  if (kernel.kind == 2) {
    const Vec k = maximum(1.0 - x, Vec{});
    rho = (1.0 - k * k * k) / 3.0;
  } else if (kernel.kind == 1) {
    rho = select(x <= 1.0, x, 2.0 * square_root(maximum(x, Vec{})) - 1.0);
  }
  return select(squared < 0.0, Vec{}, rho);
}

double cost(const double* squared, int n, KernelParameters kernel) {
  Vec sum = {};
  int i = 0;
  for (; i + kLanes <= n; i += kLanes) sum += cost_lanes(kernel, load(squared + i));
  if (i < n) {
    Vec rest = splat(-1.0);
    for (int k = 0; i + k < n; ++k) rest[k] = squared[i + k];
    sum += cost_lanes(kernel, rest);
  }
  double total = 0;
  for (int k = 0; k < kLanes; ++k) total += sum[k];
  return total;
}
