// CameraModel::project_batch: one plain loop a lens, which the compiler vectorises for each instruction set, chosen at
// run time (core/cpu_dispatch.h). Contraction to fused multiply-add is off for the whole project, so every variant
// gives the same bits.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/camera_model.h"
#include "core/cpu_dispatch.h"

namespace parallax {
namespace {

// What the loops need, in single precision.
struct Batch {
  float fx, fy, cx, cy;
  float u_min, u_max, v_min, v_max;
  float cull_radius2;  // x^2 + y^2 at z = 1
  float cull_angle;    // kannala_brandt
  float k[8];          // distortion; fov: 2 tan(omega / 2) and 1 / omega
};

// atan(t) / t for |t| <= 1 from t^2; error of the angle 2e-8 (Abramowitz and Stegun 4.4.49).
#define PARALLAX_ATAN_OVER_T(q)                               \
  (1.0f + (q) * (-0.3333314528f +                             \
                 (q) * (0.1999355085f +                       \
                        (q) * (-0.1420889944f +               \
                               (q) * (0.1065626393f +         \
                                      (q) * (-0.0752896400f + \
                                             (q) * (0.0429096138f + (q) * (-0.0161657367f + (q)*0.0028662257f))))))))

// The loops are inlined into one function an instruction set, and vectorised there.
#if defined(__GNUC__)
#define PARALLAX_LOOP inline __attribute__((always_inline))
#else
#define PARALLAX_LOOP inline
#endif

constexpr float half_pi = 1.57079632679f, pi = 3.14159265359f;

PARALLAX_LOOP void project_pinhole(const Batch& b, const float* __restrict x, const float* __restrict y,
                                   const float* __restrict z, int n, float* __restrict u, float* __restrict v,
                                   unsigned char* __restrict visible) {
  for (int i = 0; i < n; ++i) {
    const bool front = z[i] > 0;
    const float inverse = 1.0f / (front ? z[i] : 1.0f);
    const float a = x[i] * inverse * b.fx + b.cx, c = y[i] * inverse * b.fy + b.cy;
    u[i] = a;
    v[i] = c;
    visible[i] = front & (a >= b.u_min) & (a <= b.u_max) & (c >= b.v_min) & (c <= b.v_max);
  }
}

PARALLAX_LOOP void project_radtan(const Batch& b, const float* __restrict x, const float* __restrict y,
                                  const float* __restrict z, int n, float* __restrict u, float* __restrict v,
                                  unsigned char* __restrict visible) {
  for (int i = 0; i < n; ++i) {
    const bool front = z[i] > 0;
    const float inverse = 1.0f / (front ? z[i] : 1.0f);
    const float px = x[i] * inverse, py = y[i] * inverse, r2 = px * px + py * py;
    const bool inside = r2 <= b.cull_radius2;
    const float s = inside ? r2 : 0.0f;
    const float numerator = 1.0f + s * (b.k[0] + s * (b.k[1] + s * b.k[4]));
    const float denominator = 1.0f + s * (b.k[5] + s * (b.k[6] + s * b.k[7]));
    const float radial = numerator / denominator, xy2 = 2.0f * px * py;
    const float dx = px * radial + b.k[2] * xy2 + b.k[3] * (s + 2.0f * px * px);
    const float dy = py * radial + b.k[2] * (s + 2.0f * py * py) + b.k[3] * xy2;
    const float a = dx * b.fx + b.cx, c = dy * b.fy + b.cy;
    u[i] = a;
    v[i] = c;
    visible[i] = front & inside & (a >= b.u_min) & (a <= b.u_max) & (c >= b.v_min) & (c <= b.v_max);
  }
}

PARALLAX_LOOP void project_fov(const Batch& b, const float* __restrict x, const float* __restrict y,
                               const float* __restrict z, int n, float* __restrict u, float* __restrict v,
                               unsigned char* __restrict visible) {
  for (int i = 0; i < n; ++i) {
    const bool front = z[i] > 0;
    const float inverse = 1.0f / (front ? z[i] : 1.0f);
    const float px = x[i] * inverse, py = y[i] * inverse, r2 = px * px + py * py;
    const bool inside = r2 <= b.cull_radius2;
    const float r = std::sqrt((inside & (r2 > 1e-24f)) ? r2 : 1e-24f);
    const float t = b.k[0] * r;
    const bool steep = t > 1.0f;
    const float w = steep ? 1.0f / t : t;
    const float q = w * w, angle = w * PARALLAX_ATAN_OVER_T(q);
    const float g = (steep ? half_pi - angle : angle) * b.k[1] / r;
    const float a = px * g * b.fx + b.cx, c = py * g * b.fy + b.cy;
    u[i] = a;
    v[i] = c;
    visible[i] = front & inside & (a >= b.u_min) & (a <= b.u_max) & (c >= b.v_min) & (c <= b.v_max);
  }
}

PARALLAX_LOOP void project_kannala_brandt(const Batch& b, const float* __restrict x, const float* __restrict y,
                                          const float* __restrict z, int n, float* __restrict u, float* __restrict v,
                                          unsigned char* __restrict visible) {
  for (int i = 0; i < n; ++i) {
    // The angle from the axis, atan2(rho, z), over all four quadrants. On the axis (in front) rho is kept from zero.
    const float rho2 = x[i] * x[i] + y[i] * y[i], far = z[i] < 0.0f ? -z[i] : z[i];
    const float rho_true = std::sqrt(rho2);
    const float least = far * 1e-12f + 1e-30f;
    const float rho = rho_true > least ? rho_true : least;
    const bool steep = rho > far;
    const float w = steep ? far / rho : rho / far;
    const float q = w * w, base = w * PARALLAX_ATAN_OVER_T(q);
    const float quarter = steep ? half_pi - base : base;
    const float angle = z[i] < 0.0f ? pi - quarter : quarter;
    const bool inside = (angle <= b.cull_angle) & ((z[i] > 0.0f) | (rho_true > least));
    const float theta = inside ? angle : 0.0f, s = theta * theta;
    const float g = theta * (1.0f + s * (b.k[0] + s * (b.k[1] + s * (b.k[2] + s * b.k[3])))) / rho;
    const float a = x[i] * g * b.fx + b.cx, c = y[i] * g * b.fy + b.cy;
    u[i] = a;
    v[i] = c;
    visible[i] = inside & (a >= b.u_min) & (a <= b.u_max) & (c >= b.v_min) & (c <= b.v_max);
  }
}

PARALLAX_LOOP void project_kind(CameraModelKind kind, const Batch& parameters, const float* x, const float* y,
                                const float* z, int n, float* u, float* v, unsigned char* visible) {
  const Batch b = parameters;  // a copy of its own, which no output can alias
  switch (kind) {
    case CameraModelKind::pinhole:
      return project_pinhole(b, x, y, z, n, u, v, visible);
    case CameraModelKind::radtan:
      return project_radtan(b, x, y, z, n, u, v, visible);
    case CameraModelKind::kannala_brandt:
      return project_kannala_brandt(b, x, y, z, n, u, v, visible);
    case CameraModelKind::fov:
      return project_fov(b, x, y, z, n, u, v, visible);
  }
}

void project_base(CameraModelKind kind, const Batch& b, const float* x, const float* y, const float* z, int n, float* u,
                  float* v, unsigned char* visible) {
  project_kind(kind, b, x, y, z, n, u, v, visible);
}

#if PARALLAX_X86
PARALLAX_TARGET_AVX2
void project_avx2(CameraModelKind kind, const Batch& b, const float* x, const float* y, const float* z, int n, float* u,
                  float* v, unsigned char* visible) {
  project_kind(kind, b, x, y, z, n, u, v, visible);
}

PARALLAX_TARGET_AVX512
void project_avx512(CameraModelKind kind, const Batch& b, const float* x, const float* y, const float* z, int n,
                    float* u, float* v, unsigned char* visible) {
  project_kind(kind, b, x, y, z, n, u, v, visible);
}
#endif

}  // namespace

void CameraModel::project_batch(const float* x, const float* y, const float* z, int n, float border_px, float* u,
                                float* v, unsigned char* visible) const {
  Batch b{};
  b.fx = static_cast<float>(focal_.x());
  b.fy = static_cast<float>(focal_.y());
  b.cx = static_cast<float>(centre_.x());
  b.cy = static_cast<float>(centre_.y());
  b.u_min = b.v_min = border_px;
  b.u_max = static_cast<float>(width_ - 1) - border_px;
  b.v_max = static_cast<float>(height_ - 1) - border_px;
  // A border further outside the image than the margin that max_radius2_ covers: only the domain limits.
  const bool covered = border_px >= -image_margin_px;
  const double cull = covered ? std::min(max_radius2_, domain_radius2_) : domain_radius2_;
  b.cull_radius2 = static_cast<float>(std::min(cull, 1e30));
  b.cull_angle = static_cast<float>(covered && std::isfinite(cull) ? std::min(domain_angle_, std::atan(std::sqrt(cull)))
                                                                   : domain_angle_);
  for (int i = 0; i < 8; ++i) b.k[i] = static_cast<float>(distortion_[i]);
  if (kind_ == CameraModelKind::fov) {
    b.k[0] = static_cast<float>(fov_factor_);
    b.k[1] = static_cast<float>(1 / fov_omega_);
  }
#if PARALLAX_X86
  const SimdLevel level = simd_level();
  if (level >= SimdLevel::kAvx512) return project_avx512(kind_, b, x, y, z, n, u, v, visible);
  if (level >= SimdLevel::kAvx2) return project_avx2(kind_, b, x, y, z, n, u, v, visible);
#endif
  project_base(kind_, b, x, y, z, n, u, v, visible);
}

}  // namespace parallax
