// Sub-pixel alignment by inverse composition over translation and mean intensity (PTAM §5.3; Baker and Matthews 2001).
//
// The template is moved by delta against the image at p: minimise sum (T(x + delta) + m - I(x + p))^2, then p -= delta.
// With e = I - T the step is [delta; m] = H^-1 sum [dx, dy, 1] e. The window is interpolated with one set of four
// bilinear weights, held in 14-bit fixed point, so that all instruction sets see the same integers; float sums are
// taken in one fixed order (16 lanes: even and odd rows), so that they give the same bits too.
#include <algorithm>
#include <cmath>

#include "core/cpu_dispatch.h"
#include "core/intrinsics.h"
#include "core/patch.h"
#include "core/patch_normal.h"

namespace parallax {
namespace {

constexpr int kWeightBits = 14;
constexpr float kWeightScale = 1.0f / (1 << kWeightBits);
constexpr double kConvergedPx = 0.01;       // stop
constexpr double kAcceptedPx = 0.03;        // good enough when the iterations end
constexpr double kLeastInformation = 64.0;  // smallest eigenvalue of the information: 1 grey level a pixel, rms

struct BilinearWeights {
  int top_left, top_right, bottom_left, bottom_right;  // sum 2^14
};

inline BilinearWeights bilinear_weights(double fx, double fy) {
  constexpr int kOne = 1 << kWeightBits;
  const int x = static_cast<int>(fx * kOne + 0.5), y = static_cast<int>(fy * kOne + 0.5);
  const int xy = (x * y + kOne / 2) >> kWeightBits;
  return {kOne - x - y + xy, x - xy, y - xy, xy};
}

// Sums over the window of e = I - T against the template's gradients.
struct WindowSums {
  float dx_e, dy_e, e, e_squared;
};

using SumWindow = WindowSums (*)(const AlignmentTemplate& t, const std::uint8_t* window, std::size_t stride,
                                 const BilinearWeights& w);

inline float reduce_lanes(const float* lane) {
  float sum[8];
  for (int i = 0; i < 8; ++i) sum[i] = lane[i] + lane[i + 8];
  for (int i = 0; i < 4; ++i) sum[i] += sum[i + 4];
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

WindowSums sum_window_scalar(const AlignmentTemplate& t, const std::uint8_t* window, std::size_t stride,
                             const BilinearWeights& w) {
  float dx_e[16] = {}, dy_e[16] = {}, e_sum[16] = {}, e_squared[16] = {};
  for (std::size_t j = 0; j < kPatchSize; ++j, window += stride) {
    const std::uint8_t* below = window + stride;
    for (std::size_t i = 0; i < kPatchSize; ++i) {
      const int v = w.top_left * window[i] + w.top_right * window[i + 1] + w.bottom_left * below[i] +
                    w.bottom_right * below[i + 1];
      const std::size_t k = j * kPatchSize + i, lane = k & 15;
      const float e = static_cast<float>(v) * kWeightScale - t.intensity[k];
      dx_e[lane] += t.dx[k] * e;
      dy_e[lane] += t.dy[k] * e;
      e_sum[lane] += e;
      e_squared[lane] += e * e;
    }
  }
  return {reduce_lanes(dx_e), reduce_lanes(dy_e), reduce_lanes(e_sum), reduce_lanes(e_squared)};
}

#if PARALLAX_X86

// The four sums from four vectors of lanes 0 to 3 after lanes 8 apart, then 4 apart, were added: reduce_lanes()'s
// order.
inline WindowSums reduce_four(__m128 dx_e, __m128 dy_e, __m128 e, __m128 e_squared) {
  _MM_TRANSPOSE4_PS(dx_e, dy_e, e, e_squared);
  alignas(16) float sums[4];
  _mm_store_ps(sums, _mm_add_ps(_mm_add_ps(dx_e, e), _mm_add_ps(dy_e, e_squared)));
  return {sums[0], sums[1], sums[2], sums[3]};
}

inline int weight_pair(int left, int right) { return left | right << 16; }

// A row's pixels, each beside its right neighbour.
inline __m128i load_pairs(const std::uint8_t* p) {
  return _mm_unpacklo_epi8(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)),
                           _mm_loadl_epi64(reinterpret_cast<const __m128i*>(p + 1)));
}

WindowSums sum_window_sse2(const AlignmentTemplate& t, const std::uint8_t* window, std::size_t stride,
                           const BilinearWeights& w) {
  const __m128i top_weights = _mm_set1_epi32(weight_pair(w.top_left, w.top_right));
  const __m128i bottom_weights = _mm_set1_epi32(weight_pair(w.bottom_left, w.bottom_right));
  const __m128i zero = _mm_setzero_si128();
  const __m128 scale = _mm_set1_ps(kWeightScale);
  __m128 dx_e[4], dy_e[4], e_sum[4], e_squared[4];
  for (int q = 0; q < 4; ++q) dx_e[q] = dy_e[q] = e_sum[q] = e_squared[q] = _mm_setzero_ps();
  __m128i above = load_pairs(window);
  for (int j = 0; j < kPatchSize; ++j) {
    window += stride;
    const __m128i below = load_pairs(window);
    for (int half = 0; half < 2; ++half) {
      const __m128i a = half == 0 ? _mm_unpacklo_epi8(above, zero) : _mm_unpackhi_epi8(above, zero);
      const __m128i b = half == 0 ? _mm_unpacklo_epi8(below, zero) : _mm_unpackhi_epi8(below, zero);
      const __m128i v = _mm_add_epi32(_mm_madd_epi16(a, top_weights), _mm_madd_epi16(b, bottom_weights));
      const int k = j * kPatchSize + half * 4, q = (j & 1) * 2 + half;
      const __m128 e = _mm_sub_ps(_mm_mul_ps(_mm_cvtepi32_ps(v), scale), _mm_load_ps(t.intensity.data() + k));
      dx_e[q] = _mm_add_ps(dx_e[q], _mm_mul_ps(_mm_load_ps(t.dx.data() + k), e));
      dy_e[q] = _mm_add_ps(dy_e[q], _mm_mul_ps(_mm_load_ps(t.dy.data() + k), e));
      e_sum[q] = _mm_add_ps(e_sum[q], e);
      e_squared[q] = _mm_add_ps(e_squared[q], _mm_mul_ps(e, e));
    }
    above = below;
  }
  const auto fold = [](const __m128* v) { return _mm_add_ps(_mm_add_ps(v[0], v[2]), _mm_add_ps(v[1], v[3])); };
  return reduce_four(fold(dx_e), fold(dy_e), fold(e_sum), fold(e_squared));
}

PARALLAX_TARGET_AVX2 inline __m128 fold_avx2(__m256 even, __m256 odd) {
  const __m256 sum = _mm256_add_ps(even, odd);
  return _mm_add_ps(_mm256_castps256_ps128(sum), _mm256_extractf128_ps(sum, 1));
}

PARALLAX_TARGET_AVX2 WindowSums sum_window_avx2(const AlignmentTemplate& t, const std::uint8_t* window,
                                                std::size_t stride, const BilinearWeights& w) {
  const __m256i top_weights = _mm256_set1_epi32(weight_pair(w.top_left, w.top_right));
  const __m256i bottom_weights = _mm256_set1_epi32(weight_pair(w.bottom_left, w.bottom_right));
  const __m256 scale = _mm256_set1_ps(kWeightScale);
  __m256 dx_e[2], dy_e[2], e_sum[2], e_squared[2];
  for (int q = 0; q < 2; ++q) dx_e[q] = dy_e[q] = e_sum[q] = e_squared[q] = _mm256_setzero_ps();
  __m256i above = _mm256_cvtepu8_epi16(load_pairs(window));
#pragma GCC unroll 8
  for (int j = 0; j < kPatchSize; ++j) {
    window += stride;
    const __m256i below = _mm256_cvtepu8_epi16(load_pairs(window));
    const __m256i v = _mm256_add_epi32(_mm256_madd_epi16(above, top_weights), _mm256_madd_epi16(below, bottom_weights));
    const int k = j * kPatchSize, q = j & 1;
    const __m256 e = _mm256_sub_ps(_mm256_mul_ps(_mm256_cvtepi32_ps(v), scale), _mm256_load_ps(t.intensity.data() + k));
    dx_e[q] = _mm256_add_ps(dx_e[q], _mm256_mul_ps(_mm256_load_ps(t.dx.data() + k), e));
    dy_e[q] = _mm256_add_ps(dy_e[q], _mm256_mul_ps(_mm256_load_ps(t.dy.data() + k), e));
    e_sum[q] = _mm256_add_ps(e_sum[q], e);
    e_squared[q] = _mm256_add_ps(e_squared[q], _mm256_mul_ps(e, e));
    above = below;
  }
  return reduce_four(fold_avx2(dx_e[0], dx_e[1]), fold_avx2(dy_e[0], dy_e[1]), fold_avx2(e_sum[0], e_sum[1]),
                     fold_avx2(e_squared[0], e_squared[1]));
}

PARALLAX_TARGET_AVX512 inline __m128 fold_avx512(__m512 v) {
  return fold_avx2(_mm512_castps512_ps256(v), _mm512_extractf32x8_ps(v, 1));
}

PARALLAX_TARGET_AVX512 inline __m512i words_avx512(__m128i first, __m128i second) {
  return _mm512_cvtepu8_epi16(_mm256_inserti128_si256(_mm256_castsi128_si256(first), second, 1));
}

PARALLAX_TARGET_AVX512 WindowSums sum_window_avx512(const AlignmentTemplate& t, const std::uint8_t* window,
                                                    std::size_t stride, const BilinearWeights& w) {
  const __m512i top_weights = _mm512_set1_epi32(weight_pair(w.top_left, w.top_right));
  const __m512i bottom_weights = _mm512_set1_epi32(weight_pair(w.bottom_left, w.bottom_right));
  const __m512 scale = _mm512_set1_ps(kWeightScale);
  __m512 dx_e = _mm512_setzero_ps(), dy_e = dx_e, e_sum = dx_e, e_squared = dx_e;
  __m128i first = load_pairs(window);
#pragma GCC unroll 4
  for (int k = 0; k < kPatchPixels; k += 16) {
    const __m128i second = load_pairs(window + stride), third = load_pairs(window + 2 * stride);
    window += 2 * stride;
    const __m512i v = _mm512_add_epi32(_mm512_madd_epi16(words_avx512(first, second), top_weights),
                                       _mm512_madd_epi16(words_avx512(second, third), bottom_weights));
    const __m512 e = _mm512_sub_ps(_mm512_mul_ps(_mm512_cvtepi32_ps(v), scale), _mm512_load_ps(t.intensity.data() + k));
    dx_e = _mm512_add_ps(dx_e, _mm512_mul_ps(_mm512_load_ps(t.dx.data() + k), e));
    dy_e = _mm512_add_ps(dy_e, _mm512_mul_ps(_mm512_load_ps(t.dy.data() + k), e));
    e_sum = _mm512_add_ps(e_sum, e);
    e_squared = _mm512_add_ps(e_squared, _mm512_mul_ps(e, e));
    first = third;
  }
  return reduce_four(fold_avx512(dx_e), fold_avx512(dy_e), fold_avx512(e_sum), fold_avx512(e_squared));
}

#endif  // PARALLAX_X86

SumWindow sum_window() {
#if PARALLAX_X86
  switch (simd_level()) {
    case SimdLevel::kAvx512:
      return sum_window_avx512;
    case SimdLevel::kAvx2:
      return sum_window_avx2;
    case SimdLevel::kSse2:
      return sum_window_sse2;
    case SimdLevel::kScalar:
      break;
  }
#endif
  return sum_window_scalar;
}

AlignmentResult align(const AlignmentTemplate& t, const GreyImage& image, const Eigen::Vector2d& start,
                      int max_iterations, double max_shift_px, SumWindow sums_at) {
  AlignmentResult result;
  result.position = start;
  if (!t.valid) return result;
  const auto n = [&](int r, int c) { return static_cast<double>(t.inverse_normal(r, c)); };
  const double n00 = n(0, 0), n01 = n(0, 1), n02 = n(0, 2), n11 = n(1, 1), n12 = n(1, 2);
  const double x_end = image.cols - 4.0, y_end = image.rows - 4.0;
  const double max_shift_squared = max_shift_px * max_shift_px;
  double x = start.x(), y = start.y(), last_squared = HUGE_VAL;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    // The window's samples and their right and lower neighbours are columns floor(x) - 4 to floor(x) + 4. NaN fails.
    if (!(x >= 4.0 && y >= 4.0 && x < x_end && y < y_end)) return result;
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const WindowSums s =
        sums_at(t, image.ptr(top - 4) + (left - 4), image.step[0], bilinear_weights(x - left, y - top));
    const double gx = s.dx_e, gy = s.dy_e, e = s.e;
    const double step_x = n00 * gx + n01 * gy + n02 * e, step_y = n01 * gx + n11 * gy + n12 * e;
    x -= step_x;
    y -= step_y;
    result.position = {x, y};
    result.iterations = iteration + 1;
    result.mean_difference = s.e * (1.0f / kPatchPixels);
    result.rms_residual =
        std::sqrt(std::max(0.0f, (s.e_squared - s.e * result.mean_difference) * (1.0f / kPatchPixels)));
    const double shift_x = x - start.x(), shift_y = y - start.y();
    if (!(shift_x * shift_x + shift_y * shift_y <= max_shift_squared)) return result;
    last_squared = step_x * step_x + step_y * step_y;
    if (last_squared < kConvergedPx * kConvergedPx) break;
  }
  result.converged = last_squared < kAcceptedPx * kAcceptedPx;
  return result;
}

}  // namespace

namespace detail {

void finish_normal_matrix(AlignmentTemplate* t) {
  // Four lanes: as fast as the adders go, and the same order on every machine.
  constexpr std::size_t kLanes = 4;
  double sums[5][kLanes] = {};
  for (std::size_t k = 0; k < kPatchPixels; k += kLanes) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double gx = t->dx[k + i], gy = t->dy[k + i];
      sums[0][i] += gx * gx;
      sums[1][i] += gx * gy;
      sums[2][i] += gy * gy;
      sums[3][i] += gx;
      sums[4][i] += gy;
    }
  }
  const auto total = [&](std::size_t n) { return (sums[n][0] + sums[n][1]) + (sums[n][2] + sums[n][3]); };
  const double xx = total(0), xy = total(1), yy = total(2), x = total(3), y = total(4);
  // Marginalising the mean takes the mean gradient out of the translation block.
  constexpr double kCount = kPatchPixels;
  const double a = xx - x * x / kCount, b = xy - x * y / kCount, c = yy - y * y / kCount;
  const double least = 0.5 * (a + c - std::sqrt((a - c) * (a - c) + 4.0 * b * b));
  t->valid = least >= kLeastInformation;
  if (!t->valid) {
    t->inverse_normal.setZero();
    t->covariance.setZero();
    return;
  }
  const double inverse_det = 1.0 / (a * c - b * b);
  const double c00 = c * inverse_det, c01 = -b * inverse_det, c11 = a * inverse_det;
  const double m0 = -(c00 * x + c01 * y) / kCount, m1 = -(c01 * x + c11 * y) / kCount;
  const double mm = 1.0 / kCount - (m0 * x + m1 * y) / kCount;
  const auto f = [](double v) { return static_cast<float>(v); };
  t->covariance << f(c00), f(c01), f(c01), f(c11);
  t->inverse_normal << f(c00), f(c01), f(m0), f(c01), f(c11), f(m1), f(m0), f(m1), f(mm);
}

}  // namespace detail

void prepare_alignment(const PatchTemplate& t, AlignmentTemplate* out) {
  const auto at = [&](int i, int j) {
    return static_cast<float>(t.pixels[static_cast<std::size_t>(j * kPatchSize + i)]);
  };
  for (int j = 0; j < kPatchSize; ++j) {
    const int up = std::max(j - 1, 0), down = std::min(j + 1, kPatchSize - 1);
    for (int i = 0; i < kPatchSize; ++i) {
      const int left = std::max(i - 1, 0), right = std::min(i + 1, kPatchSize - 1);
      const auto k = static_cast<std::size_t>(j * kPatchSize + i);
      out->intensity[k] = at(i, j);
      out->dx[k] = (at(right, j) - at(left, j)) / static_cast<float>(right - left);
      out->dy[k] = (at(i, down) - at(i, up)) / static_cast<float>(down - up);
    }
  }
  detail::finish_normal_matrix(out);
}

AlignmentResult align_patch_scalar(const AlignmentTemplate& t, const GreyImage& image, const Eigen::Vector2d& start,
                                   int max_iterations, double max_shift_px) {
  return align(t, image, start, max_iterations, max_shift_px, sum_window_scalar);
}

AlignmentResult align_patch(const AlignmentTemplate& t, const GreyImage& image, const Eigen::Vector2d& start,
                            int max_iterations, double max_shift_px) {
  return align(t, image, start, max_iterations, max_shift_px, sum_window());
}

}  // namespace parallax
