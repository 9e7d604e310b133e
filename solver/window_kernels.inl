// The loops of window_kernels.h. Included inside an instruction set's namespace, after simd_lanes.inl.

#if PARALLAX_LANES >= 4
using RowPart = Vec4;
#else
using RowPart = Vec2;  // GCC 12 takes wider ones apart through memory
#endif
inline constexpr int kPartSize = sizeof(RowPart) / sizeof(double), kRowParts = 8 / kPartSize;
typedef RowPart RowPartUnaligned __attribute__((aligned(8), may_alias));

struct Row8 {
  RowPart part[kRowParts];
  PARALLAX_INLINE static Row8 load(const double* p) {
    Row8 row{};
    for (int i = 0; i < kRowParts; ++i) row.part[i] = *reinterpret_cast<const RowPartUnaligned*>(p + i * kPartSize);
    return row;
  }
  PARALLAX_INLINE void store(double* p) const {
    for (int i = 0; i < kRowParts; ++i) *reinterpret_cast<RowPartUnaligned*>(p + i * kPartSize) = part[i];
  }
  PARALLAX_INLINE void add(double s, const Row8& r) {
    for (int i = 0; i < kRowParts; ++i) add_product(part[i], s, r.part[i]);
  }
  PARALLAX_INLINE void subtract(double s, const Row8& r) {
    for (int i = 0; i < kRowParts; ++i) subtract_product(part[i], s, r.part[i]);
  }
};

// A point in a camera: z and, divided by it, x and y, x in the right camera, and w.
struct Seen {
  double z, inverse, x, y, right, w;
};

PARALLAX_INLINE Seen look(const WindowJob& job, const double* pose, const double* p) {
  const double x = pose[0] * p[0] + pose[1] * p[1] + pose[2] * p[2] + pose[9] * p[3];
  const double y = pose[3] * p[0] + pose[4] * p[1] + pose[5] * p[2] + pose[10] * p[3];
  const double z = pose[6] * p[0] + pose[7] * p[1] + pose[8] * p[2] + pose[11] * p[3];
  const double inverse = 1 / z;
  return {z, inverse, x * inverse, y * inverse, (x - job.baseline * p[3]) * inverse, p[3] * inverse};
}

struct Residual {
  double left, right, down;  // over sigma
};

PARALLAX_INLINE Residual residual(const WindowJob& job, const WindowObservation& o, const Seen& seen) {
  return {o.inverse_sigma * (job.fx * seen.x + job.cx - o.u_left),
          o.inverse_sigma * o.stereo * (job.fx * seen.right + job.cx - o.u_right),
          o.inverse_sigma * (job.fy * seen.y + job.cy - o.v)};
}

void evaluate(const WindowJob& job) {
  for (int point = 0; point < job.points_count; ++point)
    for (int i = job.observation_begin[point]; i < job.observation_begin[point + 1]; ++i) {
      const WindowObservation& o = job.observations[i];
      const Seen seen = look(job, job.poses + kWindowPoseStride * o.pose, job.points + 4 * point);
      const Residual r = residual(job, o, seen);
      const double squared = r.left * r.left + r.right * r.right + r.down * r.down;
      job.squared[i] = o.inverse_sigma == 0 ? -1.0 : seen.z > kWindowNearest ? squared : __builtin_inf();
    }
}

// Square root of the kernel's weight; 0 where the residual has none.
PARALLAX_INLINE double root_weight(const KernelParameters& kernel, double squared) {
  if (kernel.kind == 0) return 1;
  if (kernel.kind == 1) return squared <= kernel.c2 ? 1 : __builtin_sqrt(__builtin_sqrt(kernel.c2 / squared));
  return squared >= kernel.c2 ? 0 : 1 - squared / kernel.c2;
}

struct PointSystem {
  double v00 = 0, v10 = 0, v11 = 0, v20 = 0, v21 = 0, v22 = 0, b0 = 0, b1 = 0, b2 = 0;
  PARALLAX_INLINE void add(const double* j, double r) {
    v00 += j[0] * j[0];
    v10 += j[1] * j[0];
    v11 += j[1] * j[1];
    v20 += j[2] * j[0];
    v21 += j[2] * j[1];
    v22 += j[2] * j[2];
    b0 += j[0] * r;
    b1 += j[1] * r;
    b2 += j[2] * r;
  }
};

// The derivatives are project_homogeneous()'s, written out; s is the root of the weight over sigma.
PARALLAX_INLINE void add_observation(const WindowJob& job, const WindowObservation& o, const double* p, const Seen& at,
                                     const Residual& r, double root, PointSystem* system) {
  const double* pose = job.poses + kWindowPoseStride * o.pose;
  const double s = root * o.inverse_sigma, fx = s * job.fx, fy = s * job.fy, gx = fx * o.stereo;
  const double du = fx * at.inverse, dr = gx * at.inverse, dv = fy * at.inverse;
  const double rest[3] = {root * r.left, root * r.right, root * r.down};
  // With respect to the point: (R (w I + hat(x)) - t x^T) / 2 and -x^T / 2 of the tangent of the sphere.
  const double tangent[9] = {p[3], -p[2], p[1], p[2], p[3], -p[0], -p[1], p[0], p[3]};
  double left[3], right[3], down[3];
  for (int c = 0; c < 3; ++c) {
    const double x = pose[0] * tangent[c] + pose[1] * tangent[3 + c] + pose[2] * tangent[6 + c] - pose[9] * p[c];
    const double y = pose[3] * tangent[c] + pose[4] * tangent[3 + c] + pose[5] * tangent[6 + c] - pose[10] * p[c];
    const double z = pose[6] * tangent[c] + pose[7] * tangent[3 + c] + pose[8] * tangent[6 + c] - pose[11] * p[c];
    left[c] = 0.5 * du * (x - at.x * z);
    right[c] = 0.5 * dr * (x - at.right * z + job.baseline * p[c]);
    down[c] = 0.5 * dv * (y - at.y * z);
  }
  system->add(left, rest[0]);
  system->add(right, rest[1]);
  system->add(down, rest[2]);
  if (o.edge < 0) return;
  // With respect to the pose; at infinity (w = 0) the translation's part is zero.
  const double j[3][6] = {
      {fx * at.w, 0, -fx * at.w * at.x, -fx * at.x * at.y, fx * (1 + at.x * at.x), -fx * at.y},
      {gx * at.w, 0, -gx * at.w * at.right, -gx * at.right * at.y, gx * (1 + at.right * at.x), -gx * at.y},
      {0, fy * at.w, -fy * at.w * at.y, -fy * (1 + at.y * at.y), fy * at.x * at.y, fy * at.x}};
  Row8 row[3] = {};
  for (int k = 0; k < 3; ++k) {
    const double all[8] = {j[k][0], j[k][1], j[k][2], j[k][3], j[k][4], j[k][5], rest[k], 0};
    for (int i = 0; i < 8; ++i) row[k].part[i / kPartSize][i % kPartSize] = all[i];
  }
  double* block = job.pose_blocks + kWindowBlockStride * job.edge_slot[o.edge];
  for (int i = 0; i < 6; ++i) {
    Row8 sum = Row8::load(block + 8 * i);
    for (int k = 0; k < 3; ++k) sum.add(j[k][i], row[k]);
    sum.store(block + 8 * i);
  }
  double* edge = job.edges + kWindowEdgeStride * std::int64_t(o.edge);
  for (int c = 0; c < 3; ++c) {
    Row8 sum = Row8::load(edge + 8 * c);
    sum.add(left[c], row[0]);
    sum.add(right[c], row[1]);
    sum.add(down[c], row[2]);
    sum.store(edge + 8 * c);
  }
}

// Inverse of the Cholesky factor (lower, by rows); false: singular to what rounding leaves.
PARALLAX_INLINE bool invert_factor(const PointSystem& s, double trace, double ridge, double* out) {
  const double least = 1e-12 * trace;
  const double p0 = s.v00 + ridge;
  if (!(p0 > least)) return false;
  const double i00 = 1 / __builtin_sqrt(p0), l10 = s.v10 * i00, l20 = s.v20 * i00;
  const double p1 = s.v11 + ridge - l10 * l10;
  if (!(p1 > least)) return false;
  const double i11 = 1 / __builtin_sqrt(p1), l21 = (s.v21 - l20 * l10) * i11;
  const double p2 = s.v22 + ridge - l20 * l20 - l21 * l21;
  if (!(p2 > least)) return false;
  const double i22 = 1 / __builtin_sqrt(p2);
  out[0] = i00;
  out[1] = -i11 * l10 * i00;
  out[2] = i11;
  out[3] = -i22 * (l20 * i00 + l21 * out[1]);
  out[4] = -i22 * l21 * i11;
  out[5] = i22;
  return true;
}

PARALLAX_INLINE void eliminate(const WindowJob& job, int first, int last, const double* data) {
  const double* f = data;
  for (int k = first; k < last; ++k) {
    double* edge = job.edges + kWindowEdgeStride * std::int64_t(k);
    const Row8 w0 = Row8::load(edge), w1 = Row8::load(edge + 8), w2 = Row8::load(edge + 16);
    Row8 z0{}, z1{}, z2{};
    z0.add(f[0], w0);
    z1.add(f[1], w0);
    z1.add(f[2], w1);
    z2.add(f[3], w0);
    z2.add(f[4], w1);
    z2.add(f[5], w2);
    z0.part[6 / kPartSize][6 % kPartSize] = data[6];
    z1.part[6 / kPartSize][6 % kPartSize] = data[7];
    z2.part[6 / kPartSize][6 % kPartSize] = data[8];
    z0.store(edge);
    z1.store(edge + 8);
    z2.store(edge + 16);
  }
  for (int k = first; k < last; ++k) {
    const double* edge = job.edges + kWindowEdgeStride * std::int64_t(k);
    const Row8 z0 = Row8::load(edge), z1 = Row8::load(edge + 8), z2 = Row8::load(edge + 16);
    const std::int64_t column = job.edge_slot[k];
    for (int j = k; j < last; ++j) {
      const double* other = job.edges + kWindowEdgeStride * std::int64_t(j);
      const std::int64_t row = job.edge_slot[j];
      double* block = job.reduced + kWindowBlockStride * (row * (row + 1) / 2 + column);
      for (int i = 0; i < 6; ++i) {
        Row8 sum = Row8::load(block + 8 * i);
        sum.subtract(other[i], z0);
        sum.subtract(other[8 + i], z1);
        sum.subtract(other[16 + i], z2);
        sum.store(block + 8 * i);
      }
    }
  }
}

void linearise(const WindowJob& job) {
  for (int point = 0; point < job.points_count; ++point) {
    const int first = job.edge_begin[point], last = job.edge_begin[point + 1];
    const double* p = job.points + 4 * point;
    double* data = job.point_data + kWindowPointStride * point;
    for (int i = 0; i < kWindowPointStride; ++i) data[i] = 0;
    for (std::int64_t i = std::int64_t(kWindowEdgeStride) * first; i < std::int64_t(kWindowEdgeStride) * last; ++i)
      job.edges[i] = 0;
    PointSystem system;
    for (int i = job.observation_begin[point]; i < job.observation_begin[point + 1]; ++i) {
      const WindowObservation& o = job.observations[i];
      if (o.inverse_sigma == 0) continue;
      const Seen seen = look(job, job.poses + kWindowPoseStride * o.pose, p);
      if (!(seen.z > kWindowNearest)) continue;
      const Residual r = residual(job, o, seen);
      const double root = root_weight(job.kernel, r.left * r.left + r.right * r.right + r.down * r.down);
      if (root > 0) add_observation(job, o, p, seen, r, root, &system);
    }
    const double trace = system.v00 + system.v11 + system.v22;
    if (!(trace > 0)) continue;  // no observation of any weight: it stays where it is
    if (!invert_factor(system, trace, 0, data) && !invert_factor(system, trace, 1e-9 * trace, data)) {
      // Not finite; the caller sees it in the poses' blocks.
      for (int i = 0; i < 6; ++i) data[i] = 0;
    }
    data[6] = data[0] * system.b0;
    data[7] = data[1] * system.b0 + data[2] * system.b1;
    data[8] = data[3] * system.b0 + data[4] * system.b1 + data[5] * system.b2;
    eliminate(job, first, last, data);
  }
}

void substitute(const WindowJob& job, const double* steps, double* white) {
  for (int point = 0; point < job.points_count; ++point) {
    RowPart sum[3] = {};
    for (int k = job.edge_begin[point]; k < job.edge_begin[point + 1]; ++k) {
      const double* edge = job.edges + kWindowEdgeStride * std::int64_t(k);
      const Row8 step = Row8::load(steps + 8 * job.edge_slot[k]);
      for (int c = 0; c < 3; ++c) {
        const Row8 row = Row8::load(edge + 8 * c);
        for (int i = 0; i < kRowParts; ++i) sum[c] += row.part[i] * step.part[i];
      }
    }
    const double* data = job.point_data + kWindowPointStride * point;
    for (int c = 0; c < 3; ++c) {
      double total = data[6 + c];
      for (int i = 0; i < kPartSize; ++i) total += sum[c][i];
      white[3 * point + c] = -total;
    }
  }
}

extern const WindowKernels kernels;
const WindowKernels kernels = {evaluate, linearise, substitute};
