// Salience of single pixels: FAST score, maximal corners, Shi-Tomasi score, and the adaptive threshold.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/cpu_dispatch.h"
#include "core/fast.h"
#include "core/fast_rows.h"
#include "core/intrinsics.h"

namespace parallax {
namespace {

int score_scalar(const std::uint8_t* p, std::ptrdiff_t stride) {
  int ring[32];
  for (int k = 0; k < 16; ++k) {
    ring[k] = ring[k + 16] = p[detail::kFastCircle[k].y * stride + detail::kFastCircle[k].x];
  }
  // A bright corner at threshold t: the darkest of some 10 in a row is above centre + t. Dark: the other way round.
  int bright = 0, dark = 255;
  for (int k = 0; k < 16; ++k) {
    bright = std::max(bright, *std::min_element(ring + k, ring + k + 10));
    dark = std::min(dark, *std::max_element(ring + k, ring + k + 10));
  }
  return std::max({bright - *p - 1, *p - dark - 1, 0});
}

#if PARALLAX_X86

template <int kBytes>
inline __m128i rotate(__m128i v) {
  return _mm_or_si128(_mm_srli_si128(v, kBytes), _mm_slli_si128(v, 16 - kBytes));
}

// The best over the 16 runs of ten of the worst within the run.
inline int best_run_sse2(__m128i ring) {
  const __m128i two = _mm_min_epu8(ring, rotate<1>(ring)), four = _mm_min_epu8(two, rotate<2>(two));
  const __m128i eight = _mm_min_epu8(four, rotate<4>(four)), ten = _mm_min_epu8(eight, rotate<8>(two));
  __m128i best = _mm_max_epu8(ten, _mm_srli_si128(ten, 8));
  best = _mm_max_epu8(best, _mm_srli_si128(best, 4));
  best = _mm_max_epu8(best, _mm_srli_si128(best, 2));
  best = _mm_max_epu8(best, _mm_srli_si128(best, 1));
  return _mm_cvtsi128_si32(best) & 255;
}

int score_sse2(const std::uint8_t* p, std::ptrdiff_t stride) {
  std::uint64_t half[2] = {0, 0};
  for (int k = 0; k < 16; ++k) {
    const std::uint64_t v = p[detail::kFastCircle[k].y * stride + detail::kFastCircle[k].x];
    half[k / 8] |= v << (k % 8 * 8);
  }
  const __m128i ring = _mm_set_epi64x(static_cast<long long>(half[1]), static_cast<long long>(half[0]));
  const int bright = best_run_sse2(ring), dark = 255 - best_run_sse2(_mm_xor_si128(ring, _mm_set1_epi8(-1)));
  return std::max({bright - *p - 1, *p - dark - 1, 0});
}

inline __m128i load_words(const std::uint8_t* p) {
  return _mm_unpacklo_epi8(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)), _mm_setzero_si128());
}

inline int sum_lanes(__m128i v) {
  v = _mm_add_epi32(v, _mm_shuffle_epi32(v, 0x4e));
  v = _mm_add_epi32(v, _mm_shuffle_epi32(v, 0xb1));
  return _mm_cvtsi128_si32(v);
}

// Gradient sums over the 7x7 window around p; reads up to 5 px to its right.
void gradient_sums_sse2(const std::uint8_t* p, std::ptrdiff_t stride, std::int64_t* xx, std::int64_t* xy,
                        std::int64_t* yy) {
  const __m128i seven = _mm_setr_epi16(-1, -1, -1, -1, -1, -1, -1, 0);
  __m128i sum_xx = _mm_setzero_si128(), sum_xy = sum_xx, sum_yy = sum_xx;
  for (const std::uint8_t *row = p - 3 * stride - 3, *end = row + 7 * stride; row != end; row += stride) {
    const __m128i gx = _mm_and_si128(_mm_sub_epi16(load_words(row + 1), load_words(row - 1)), seven);
    const __m128i gy = _mm_and_si128(_mm_sub_epi16(load_words(row + stride), load_words(row - stride)), seven);
    sum_xx = _mm_add_epi32(sum_xx, _mm_madd_epi16(gx, gx));
    sum_xy = _mm_add_epi32(sum_xy, _mm_madd_epi16(gx, gy));
    sum_yy = _mm_add_epi32(sum_yy, _mm_madd_epi16(gy, gy));
  }
  *xx = sum_lanes(sum_xx);
  *xy = sum_lanes(sum_xy);
  *yy = sum_lanes(sum_yy);
}

#endif  // PARALLAX_X86

void gradient_sums_scalar(const std::uint8_t* p, std::ptrdiff_t stride, int half, std::int64_t* xx, std::int64_t* xy,
                          std::int64_t* yy) {
  for (int v = -half; v <= half; ++v) {
    const std::uint8_t* row = p + v * stride;
    for (int u = -half; u <= half; ++u) {
      const int gx = row[u + 1] - row[u - 1], gy = row[u + stride] - row[u - stride];
      *xx += gx * gx;
      *xy += gx * gy;
      *yy += gy * gy;
    }
  }
}

}  // namespace

int fast_score(const GreyImage& image, int x, int y) {
  if (x < 3 || y < 3 || x + 3 >= image.cols || y + 3 >= image.rows) return 0;
  const std::uint8_t* p = image.ptr(y) + x;
  const auto stride = static_cast<std::ptrdiff_t>(image.step[0]);
#if PARALLAX_X86
  if (simd_level() != SimdLevel::kScalar) return score_sse2(p, stride);
#endif
  return score_scalar(p, stride);
}

std::vector<Corner> maximal_corners(const GreyImage& image, const CornerList& list) {
  const std::vector<Corner>& corners = list.corners;
  const std::size_t count = corners.size();
  std::vector<int> score(count);
  for (std::size_t i = 0; i < count; ++i) score[i] = fast_score(image, corners[i].x, corners[i].y);

  // suppressed[i]: a neighbour scores higher, or as high and comes first.
  std::vector<std::uint8_t> suppressed(count, 0);
  const auto compare = [&](std::size_t earlier, std::size_t later) {
    suppressed[score[earlier] >= score[later] ? later : earlier] = 1;
  };
  std::size_t above = 0;  // first corner of the row above that may still touch the current one
  for (std::size_t i = 0; i < count; ++i) {
    const Corner c = corners[i];
    if (i > 0 && corners[i - 1].y == c.y && corners[i - 1].x == c.x - 1) compare(i - 1, i);
    while (above < i && (corners[above].y < c.y - 1 || (corners[above].y == c.y - 1 && corners[above].x < c.x - 1))) {
      ++above;
    }
    for (std::size_t j = above; j < i && corners[j].y == c.y - 1 && corners[j].x <= c.x + 1; ++j) compare(j, i);
  }
  std::vector<Corner> maximal;
  for (std::size_t i = 0; i < count; ++i) {
    if (suppressed[i] == 0) maximal.push_back(corners[i]);
  }
  return maximal;
}

float shi_tomasi_score(const GreyImage& image, int x, int y, int half) {
  if (half < 0 || x < half + 1 || y < half + 1 || x + half + 1 >= image.cols || y + half + 1 >= image.rows) return 0;
  const auto stride = static_cast<std::ptrdiff_t>(image.step[0]);
  std::int64_t xx = 0, xy = 0, yy = 0;  // sums over twice the gradient
  const std::uint8_t* p = image.ptr(y) + x;
#if PARALLAX_X86
  if (half == 3 && x + 5 < image.cols && simd_level() != SimdLevel::kScalar) {
    gradient_sums_sse2(p, stride, &xx, &xy, &yy);
  } else {
    gradient_sums_scalar(p, stride, half, &xx, &xy, &yy);
  }
#else
  gradient_sums_scalar(p, stride, half, &xx, &xy, &yy);
#endif
  const double size = 2.0 * half + 1.0, scale = 0.25 / (size * size);
  const double a = static_cast<double>(xx) * scale, b = static_cast<double>(xy) * scale,
               c = static_cast<double>(yy) * scale;
  const double difference = a - c;
  return static_cast<float>(std::max(0.0, 0.5 * (a + c - std::sqrt(difference * difference + 4.0 * b * b))));
}

void AdaptiveThreshold::update(int found) {
  // The count falls by roughly an eighth with each grey level, so a step of log(ratio) / 0.25 is half of what is
  // missing: it does not overshoot. Within the dead band nothing moves.
  constexpr double kDeadBand = 0.2;     // log of the ratio found / target
  constexpr double kLogPerStep = 0.25;  // log of the ratio that one grey level may make up for
  constexpr int kMaxStep = 3;           // grey levels a frame
  const double error = std::log(std::max(found, 1) / static_cast<double>(std::max(target, 1)));
  const int wanted = error > 0 ? 1 : -1;
  if (std::abs(error) <= kDeadBand) {
    last_step = 0;
    return;
  }
  // Turning round: one grey level at most, and none at all when the target lies between two neighbouring thresholds and
  // this one is the nearer to it. Otherwise the threshold would swing for ever.
  const bool turning = last_step * wanted < 0;
  if (last_step == -wanted && std::abs(error) <= last_error) return;
  const int size = turning ? 1 : std::clamp(static_cast<int>(std::abs(error) / kLogPerStep), 1, kMaxStep);
  const int moved = std::clamp(threshold + wanted * size, min_threshold, std::max(min_threshold, max_threshold));
  last_step = moved - threshold;
  last_error = std::abs(error);
  threshold = moved;
}

}  // namespace parallax
