#include "render/synthetic_kernels.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define PARALLAX_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#define PARALLAX_GATHER
#include <immintrin.h>
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

PARALLAX_CLONES
void plane_texels(const float* __restrict x, const float* __restrict y, const float* __restrict inverse_depth, int n,
                  const PlaneCoefficients& c, float width, float height, float* __restrict s, float* __restrict t) {
  const float s0 = c.s[0], s1 = c.s[1], s2 = c.s[2], t0 = c.t[0], t1 = c.t[1], t2 = c.t[2];
  for (int i = 0; i < n; ++i) {
    const float z = 1.0f / inverse_depth[i];
    const float a = (s0 * x[i] + s1 * y[i] + s2) * z * width, b = (t0 * x[i] + t1 * y[i] + t2) * z * height;
    const float a1 = a < 0.0f ? 0.0f : a, b1 = b < 0.0f ? 0.0f : b;
    s[i] = width < a1 ? width : a1;
    t[i] = height < b1 ? height : b1;
  }
}

namespace {

void add_grey_plain(const GreyTexels& texels, const float* s, const float* t, int n, float shade, float* sum) {
  for (int i = 0; i < n; ++i) {
    const float x = s[i] * texels.scale + 0.5f, y = t[i] * texels.scale + 0.5f;
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const std::uint8_t *a = texels.data + iy * texels.step + ix, *b = a + texels.step;
    const float top = static_cast<float>(a[0]) + fx * static_cast<float>(a[1] - a[0]);
    const float bottom = static_cast<float>(b[0]) + fx * static_cast<float>(b[1] - b[0]);
    sum[i] += shade * (top + fy * (bottom - top));
  }
}

#ifdef PARALLAX_GATHER
// Eight at a time. A look-up reads four bytes for the sake of two; the border of a picture is wide enough for that.
__attribute__((target("avx2"))) void add_grey_gathered(const GreyTexels& texels, const float* s, const float* t, int n,
                                                       float shade, float* sum) {
  const __m256 scale = _mm256_set1_ps(texels.scale), half = _mm256_set1_ps(0.5f), factor = _mm256_set1_ps(shade);
  const __m256i step = _mm256_set1_epi32(static_cast<int>(texels.step)), byte = _mm256_set1_epi32(255);
  const int* row = reinterpret_cast<const int*>(texels.data);
  const int* next = reinterpret_cast<const int*>(texels.data + texels.step);
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), none = _mm256_setzero_si256();
  for (int i = 0; i < n; i += 8) {
    const __m256i live = _mm256_cmpgt_epi32(_mm256_set1_epi32(n - i), lanes);
    const __m256 x = _mm256_add_ps(_mm256_mul_ps(_mm256_maskload_ps(s + i, live), scale), half);
    const __m256 y = _mm256_add_ps(_mm256_mul_ps(_mm256_maskload_ps(t + i, live), scale), half);
    const __m256i ix = _mm256_cvttps_epi32(x), iy = _mm256_cvttps_epi32(y);
    const __m256 fx = _mm256_sub_ps(x, _mm256_cvtepi32_ps(ix)), fy = _mm256_sub_ps(y, _mm256_cvtepi32_ps(iy));
    const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(iy, step), ix);
    const __m256i a = _mm256_mask_i32gather_epi32(none, row, at, live, 1);
    const __m256i b = _mm256_mask_i32gather_epi32(none, next, at, live, 1);
    const __m256i a0 = _mm256_and_si256(a, byte), a1 = _mm256_and_si256(_mm256_srli_epi32(a, 8), byte);
    const __m256i b0 = _mm256_and_si256(b, byte), b1 = _mm256_and_si256(_mm256_srli_epi32(b, 8), byte);
    const __m256 top =
        _mm256_add_ps(_mm256_cvtepi32_ps(a0), _mm256_mul_ps(fx, _mm256_cvtepi32_ps(_mm256_sub_epi32(a1, a0))));
    const __m256 bottom =
        _mm256_add_ps(_mm256_cvtepi32_ps(b0), _mm256_mul_ps(fx, _mm256_cvtepi32_ps(_mm256_sub_epi32(b1, b0))));
    const __m256 value = _mm256_add_ps(top, _mm256_mul_ps(fy, _mm256_sub_ps(bottom, top)));
    _mm256_maskstore_ps(sum + i, live, _mm256_add_ps(_mm256_maskload_ps(sum + i, live), _mm256_mul_ps(factor, value)));
  }
}
#endif

}  // namespace

void add_grey_texels(const GreyTexels& texels, const float* s, const float* t, int n, float shade, float* sum) {
#ifdef PARALLAX_GATHER
  static const bool gather = __builtin_cpu_supports("avx2") != 0;
  if (gather) return add_grey_gathered(texels, s, t, n, shade, sum);
#endif
  add_grey_plain(texels, s, t, n, shade, sum);
}

PARALLAX_CLONES
float smallest(const float* __restrict values, int n) {
  // Floats that are not negative are in the order of their bits.
  std::int32_t least = std::numeric_limits<std::int32_t>::max();
  for (int i = 0; i < n; ++i) {
    const std::int32_t bits = std::bit_cast<std::int32_t>(values[i]);
    least = bits < least ? bits : least;
  }
  return std::bit_cast<float>(least);
}

}  // namespace parallax::detail
