// Pose refinement in lanes: projection with Jacobians, linear update of the residuals, and the normal equations.
// Included inside an instruction set's namespace.

template <Lens kLens>
void pose_project(const PoseJob& job) {
  const double* T = job.pose;
  for (int i = 0; i < job.count; i += kLanes) {
    const Vec x = load(job.x + i), y = load(job.y + i), z = load(job.z + i), is = load(job.inverse_sigma + i);
    Vec P[3];
    for (int k = 0; k < 3; ++k)
      P[k] = fma(splat(T[3 * k]), x, fma(splat(T[3 * k + 1]), y, fma(splat(T[3 * k + 2]), z, splat(T[9 + k]))));
    Projection o;
    LensLanes<kLens>::project(job.lens, P[0], P[1], P[2], nullptr, &o);
    const Vec ru = (o.u - load(job.u + i)) * is, rv = (o.v - load(job.v + i)) * is, s = fma(ru, ru, rv * rv);
    const Mask valid = o.valid & (is > 0.0) & (s < 1e30);
    store(job.ru + i, select(valid, ru, Vec{}));
    store(job.rv + i, select(valid, rv, Vec{}));
    store(job.squared + i, select(valid, s, splat(kUnusedSquared)));
    for (int row = 0; row < 2; ++row) {
      const Vec* j = o.j + 3 * row;
      const Vec column[6] = {
          j[0], j[1], j[2], P[1] * j[2] - P[2] * j[1], P[2] * j[0] - P[0] * j[2], P[0] * j[1] - P[1] * j[0]};
      for (int k = 0; k < 6; ++k)
        store(job.jacobian + (6 * row + k) * job.stride + i, select(valid, column[k] * is, Vec{}));
    }
  }
}

void pose_advance(const PoseJob& job, const double* mu) {
  for (int i = 0; i < job.count; i += kLanes) {
    Vec ru = load(job.ru + i), rv = load(job.rv + i);
    for (int k = 0; k < 6; ++k) {
      const Vec m = splat(mu[k]);
      ru = fma(load(job.jacobian + k * job.stride + i), m, ru);
      rv = fma(load(job.jacobian + (6 + k) * job.stride + i), m, rv);
    }
    store(job.ru + i, ru);
    store(job.rv + i, rv);
    const Vec s = load(job.squared + i);
    store(job.squared + i, select(s < kUnusedSquared, fma(ru, ru, rv * rv), s));
  }
}

// Upper triangle of sum w J^T J by rows (21), sum w J^T r (6), sums of w, w^2 s and w + s dw/ds, number of weights > 0.
void pose_normal(const PoseJob& job, KernelParameters kernel, double* out) {
  Vec sum[kPoseSums] = {};
  for (int i = 0; i < job.count; i += kLanes) {
    const Vec s = load(job.squared + i), q = s / kernel.c2;
    Vec w, slope;  // weight, and s dw/ds
    if (kernel.kind == 2) {
      const Vec k = maximum(1.0 - q, Vec{});
      w = k * k;
      slope = -2.0 * k * q;
    } else if (kernel.kind == 1) {
      w = select(q <= 1.0, splat(1.0), 1.0 / square_root(maximum(q, splat(1.0))));
      slope = select(q <= 1.0, Vec{}, -0.5 * w);
    } else {
      w = splat(1.0);
      slope = Vec{};
    }
    const Mask used = (s < kUnusedSquared) & (w > 0.0);
    w = select(used, w, Vec{});
    const Vec ru = load(job.ru + i), rv = load(job.rv + i);
    Vec a[6], b[6];
    for (int k = 0; k < 6; ++k) {
      a[k] = load(job.jacobian + k * job.stride + i);
      b[k] = load(job.jacobian + (6 + k) * job.stride + i);
    }
    // Unrolled, so that the sums stay in registers.
#pragma GCC unroll 6
    for (int r = 0; r < 6; ++r) {
      const Vec wa = w * a[r], wb = w * b[r];
#pragma GCC unroll 6
      for (int c = r; c < 6; ++c) {
        const int n = c + r * (11 - r) / 2;
        sum[n] = fma(wa, a[c], fma(wb, b[c], sum[n]));
      }
      sum[21 + r] = fma(wa, ru, fma(wb, rv, sum[21 + r]));
    }
    sum[27] += w;
    sum[28] += select(used, w * w * s, Vec{});
    sum[29] += select(used, w + slope, Vec{});
    sum[30] += select(used, splat(1.0), Vec{});
  }
  for (int k = 0; k < kPoseSums; ++k) {
    out[k] = 0;
    for (int l = 0; l < kLanes; ++l) out[k] += sum[k][l];
  }
}
