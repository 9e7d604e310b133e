#include "render/synthetic_kernels.h"

#include <cmath>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define PARALLAX_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define PARALLAX_CLONES
#endif

namespace parallax::detail {

PARALLAX_CLONES
void cast_rectangle(const float* __restrict x, const float* __restrict y, int n, const PlaneCoefficients& c, int id,
                    float* __restrict inverse_depth, int* __restrict ids) {
  const float w0 = c.w[0], w1 = c.w[1], w2 = c.w[2], s0 = c.s[0], s1 = c.s[1], s2 = c.s[2];
  const float t0 = c.t[0], t1 = c.t[1], t2 = c.t[2];
  for (int i = 0; i < n; ++i) {
    const float w = w0 * x[i] + w1 * y[i] + w2;
    const float s = s0 * x[i] + s1 * y[i] + s2;
    const float t = t0 * x[i] + t1 * y[i] + t2;
    const bool hit = (w > inverse_depth[i]) & (s >= 0.0f) & (s <= w) & (t >= 0.0f) & (t <= w);
    inverse_depth[i] = hit ? w : inverse_depth[i];
    ids[i] = hit ? id : ids[i];
  }
}

PARALLAX_CLONES
void cast_disc(const float* __restrict x, const float* __restrict y, int n, const PlaneCoefficients& c, int id,
               float* __restrict inverse_depth, int* __restrict ids) {
  const float w0 = c.w[0], w1 = c.w[1], w2 = c.w[2], s0 = c.s[0], s1 = c.s[1], s2 = c.s[2];
  const float t0 = c.t[0], t1 = c.t[1], t2 = c.t[2];
  for (int i = 0; i < n; ++i) {
    const float w = w0 * x[i] + w1 * y[i] + w2;
    const float s = s0 * x[i] + s1 * y[i] + s2 - 0.5f * w;
    const float t = t0 * x[i] + t1 * y[i] + t2 - 0.5f * w;
    const bool hit = (w > inverse_depth[i]) & (s * s + t * t <= 0.25f * w * w);
    inverse_depth[i] = hit ? w : inverse_depth[i];
    ids[i] = hit ? id : ids[i];
  }
}

PARALLAX_CLONES
void cast_cylinder(const float* __restrict x, const float* __restrict y, int n, const CylinderCoefficients& c, int id,
                   float* __restrict inverse_depth, int* __restrict ids) {
  const CylinderCoefficients k = c;
  for (int i = 0; i < n; ++i) {
    const float d0 = k.d[0][0] * x[i] + k.d[0][1] * y[i] + k.d[0][2];
    const float d1 = k.d[1][0] * x[i] + k.d[1][1] * y[i] + k.d[1][2];
    const float d2 = k.d[2][0] * x[i] + k.d[2][1] * y[i] + k.d[2][2];
    const float a = d0 * d0 + d1 * d1;
    const float b = k.o[0] * d0 + k.o[1] * d1;
    // b^2 - a offset, with the camera's two components taken across the ray: no cancellation for a distant camera.
    const float across = k.o[0] * d1 - k.o[1] * d0;
    const float discriminant = a * k.radius_squared - across * across;
    const bool real = discriminant >= 0.0f;
    const float root = std::sqrt(real ? discriminant : 0.0f);
    const float near_z = (-b - root) / a, far_z = (-b + root) / a;
    const float near_h = k.o[2] + near_z * d2, far_h = k.o[2] + far_z * d2;
    const bool near_ok = (near_z > 0.0f) & (near_h >= 0.0f) & (near_h <= k.height);
    const bool far_ok = (far_z > 0.0f) & (far_h >= 0.0f) & (far_h <= k.height);
    const float z = near_ok ? near_z : far_z;
    const float w = 1.0f / z;
    const bool hit = real & (near_ok | far_ok) & (w > inverse_depth[i]);
    inverse_depth[i] = hit ? w : inverse_depth[i];
    ids[i] = hit ? id : ids[i];
  }
}

}  // namespace parallax::detail
