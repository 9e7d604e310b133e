// Zero-mean SSD over 8x8 blocks (PTAM §5.3). With D = I - T the score is sum D^2 - (sum D)^2 / 64: one pass over the
// differences, all in integers.
#include <algorithm>
#include <climits>
#include <cmath>

#include "core/cpu_dispatch.h"
#include "core/fast.h"
#include "core/intrinsics.h"
#include "core/patch.h"

namespace parallax {
namespace {

// sum D^2 - (sum D)^2 / 64, rounded down.
inline int score_from_sums(int sum, int sum_squares) { return sum_squares - ((sum * sum + 63) >> 6); }

inline int zmssd_block_scalar(const std::uint8_t* t, const std::uint8_t* block, std::size_t stride) {
  int sum = 0, sum_squares = 0;
  for (int j = 0; j < kPatchSize; ++j, block += stride, t += kPatchSize) {
    for (int i = 0; i < kPatchSize; ++i) {
      const int d = block[i] - t[i];
      sum += d;
      sum_squares += d * d;
    }
  }
  return score_from_sums(sum, sum_squares);
}

// The corners a search has still to evaluate, and the best so far.
struct Search {
  const PatchTemplate& t;
  const GreyImage& image;
  int best;
  Corner best_corner{};
  bool found = false;

  const std::uint8_t* block(const Corner& c) const {
    return image.data + static_cast<std::ptrdiff_t>(image.step[0]) * (c.y - 4) + (c.x - 4);
  }
  void offer(int score, const Corner& c) {
    if (score >= best) return;
    best = score;
    best_corner = c;
    found = true;
  }
};

constexpr std::size_t kQueueSize = 64;  // corners evaluated in one go
constexpr std::size_t kQueueSlack = 8;  // vector writes may run over
constexpr int kBlock = kPatchSize / 2;

// Appends the corners of [begin, end), one row's, with x in [first, last] to `queue`; `end_of_list` bounds what may be
// read. At most end - begin are added; returns how many.
using SelectColumns = std::size_t (*)(const Corner* begin, const Corner* end, const Corner* end_of_list, int first,
                                      int last, Corner* queue);
// Offers `count` corners in order.
using Evaluate = void (*)(const Corner* corners, std::size_t count, Search* search);

std::size_t select_columns_scalar(const Corner* begin, const Corner* end, const Corner*, int first, int last,
                                  Corner* queue) {
  Corner* out = queue;
  for (; begin != end && begin->x < first; ++begin) {
  }
  for (; begin != end && begin->x <= last; ++begin) *out++ = *begin;
  return static_cast<std::size_t>(out - queue);
}

void evaluate_scalar(const Corner* corners, std::size_t count, Search* s) {
  for (std::size_t k = 0; k < count; ++k) {
    s->offer(zmssd_block_scalar(s->t.pixels.data(), s->block(corners[k]), s->image.step[0]), corners[k]);
  }
}

#if PARALLAX_X86

inline int sum_lanes(__m128i v) {
  v = _mm_add_epi32(v, _mm_shuffle_epi32(v, 0x4e));
  v = _mm_add_epi32(v, _mm_shuffle_epi32(v, 0xb1));
  return _mm_cvtsi128_si32(v);
}

int zmssd_block_sse2(const std::uint8_t* t, const std::uint8_t* block, std::size_t stride) {
  const __m128i zero = _mm_setzero_si128();
  __m128i sum = zero, sum_squares = zero;
  for (int j = 0; j < kPatchSize; j += 2, block += 2 * stride, t += 2 * kPatchSize) {
    const __m128i template_rows = _mm_load_si128(reinterpret_cast<const __m128i*>(t));
    const __m128i row0 = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(block));
    const __m128i row1 = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(block + stride));
    const __m128i d0 = _mm_sub_epi16(_mm_unpacklo_epi8(row0, zero), _mm_unpacklo_epi8(template_rows, zero));
    const __m128i d1 = _mm_sub_epi16(_mm_unpacklo_epi8(row1, zero), _mm_unpackhi_epi8(template_rows, zero));
    sum = _mm_add_epi16(sum, _mm_add_epi16(d0, d1));
    sum_squares = _mm_add_epi32(sum_squares, _mm_add_epi32(_mm_madd_epi16(d0, d0), _mm_madd_epi16(d1, d1)));
  }
  return score_from_sums(sum_lanes(_mm_madd_epi16(sum, _mm_set1_epi16(1))), sum_lanes(sum_squares));
}

void evaluate_sse2(const Corner* corners, std::size_t count, Search* s) {
  for (std::size_t k = 0; k < count; ++k) {
    s->offer(zmssd_block_sse2(s->t.pixels.data(), s->block(corners[k]), s->image.step[0]), corners[k]);
  }
}

PARALLAX_TARGET_AVX2 std::size_t select_columns_avx2(const Corner* begin, const Corner* end, const Corner* end_of_list,
                                                     int first, int last, Corner* queue) {
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i below = _mm256_set1_epi32(first - 1), above = _mm256_set1_epi32(last + 1);
  Corner* out = queue;
  for (; begin < end && end_of_list - begin >= 8; begin += 8) {
    const __m256i corners = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(begin));
    const __m256i x = _mm256_srai_epi32(_mm256_slli_epi32(corners, 16), 16);
    const __m256i in = _mm256_and_si256(_mm256_cmpgt_epi32(x, below), _mm256_cmpgt_epi32(above, x));
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(in)));
    const auto left = end - begin;
    if (left < 8) mask &= (1u << left) - 1u;  // the rest belongs to the next row
    // Columns ascend, so the chosen ones stand side by side: move them to the front.
    const __m256i from = _mm256_add_epi32(lanes, _mm256_set1_epi32(static_cast<int>(_tzcnt_u32(mask))));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_permutevar8x32_epi32(corners, from));
    out += __builtin_popcount(mask);
  }
  if (begin < end) out += select_columns_scalar(begin, end, end_of_list, first, last, out);
  return static_cast<std::size_t>(out - queue);
}

PARALLAX_TARGET_AVX2 inline __m256i two_rows(const std::uint8_t* p, std::size_t stride) {
  const __m128i low = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(p));
  const auto* second = reinterpret_cast<const double*>(p + stride);
  return _mm256_cvtepu8_epi16(_mm_castpd_si128(_mm_loadh_pd(_mm_castsi128_pd(low), second)));
}

// Lane sums of the differences (words) and of their squares.
PARALLAX_TARGET_AVX2 inline void differences_avx2(const __m256i* t, const std::uint8_t* block, std::size_t stride,
                                                  __m256i* sum, __m256i* sum_squares) {
  const __m256i d0 = _mm256_sub_epi16(two_rows(block, stride), t[0]);
  const __m256i d1 = _mm256_sub_epi16(two_rows(block + 2 * stride, stride), t[1]);
  const __m256i d2 = _mm256_sub_epi16(two_rows(block + 4 * stride, stride), t[2]);
  const __m256i d3 = _mm256_sub_epi16(two_rows(block + 6 * stride, stride), t[3]);
  const __m256i words = _mm256_add_epi16(_mm256_add_epi16(d0, d1), _mm256_add_epi16(d2, d3));
  *sum = _mm256_madd_epi16(words, _mm256_set1_epi16(1));
  *sum_squares = _mm256_add_epi32(_mm256_add_epi32(_mm256_madd_epi16(d0, d0), _mm256_madd_epi16(d1, d1)),
                                  _mm256_add_epi32(_mm256_madd_epi16(d2, d2), _mm256_madd_epi16(d3, d3)));
}

PARALLAX_TARGET_AVX2 inline void load_template_avx2(const PatchTemplate& t, __m256i* rows) {
  for (int k = 0; k < 4; ++k) rows[k] = two_rows(t.pixels.data() + 16 * k, 8);
}

PARALLAX_TARGET_AVX2 int zmssd_block_avx2(const PatchTemplate& t, const std::uint8_t* block, std::size_t stride) {
  __m256i rows[4], sum, squares;
  load_template_avx2(t, rows);
  differences_avx2(rows, block, stride, &sum, &squares);
  // Both sums in one vector: [sum, sum, squares, squares] in each half.
  const __m256i both = _mm256_hadd_epi32(sum, squares);
  __m128i v = _mm_add_epi32(_mm256_castsi256_si128(both), _mm256_extracti128_si256(both, 1));
  v = _mm_add_epi32(v, _mm_shuffle_epi32(v, 0xb1));
  return score_from_sums(_mm_cvtsi128_si32(v), _mm_extract_epi32(v, 2));
}

// The sums over the lanes of four vectors.
PARALLAX_TARGET_AVX2 inline __m128i reduce_four(const __m256i* v) {
  const __m256i sums = _mm256_hadd_epi32(_mm256_hadd_epi32(v[0], v[1]), _mm256_hadd_epi32(v[2], v[3]));
  return _mm_add_epi32(_mm256_castsi256_si128(sums), _mm256_extracti128_si256(sums, 1));
}

PARALLAX_TARGET_AVX2 void evaluate_avx2(const Corner* corners, std::size_t count, Search* s) {
  const std::size_t stride = s->image.step[0];
  __m256i rows[4];
  load_template_avx2(s->t, rows);
  for (std::size_t k = 0; k < count; k += 4) {
    __m256i sum[4], squares[4];
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t at = k + i < count ? k + i : count - 1;  // the last again: an equal score never replaces
      differences_avx2(rows, s->block(corners[at]), stride, &sum[i], &squares[i]);
    }
    const __m128i total = reduce_four(sum);
    const __m128i mean_part = _mm_srli_epi32(_mm_add_epi32(_mm_mullo_epi32(total, total), _mm_set1_epi32(63)), 6);
    const __m128i score = _mm_sub_epi32(reduce_four(squares), mean_part);
    if (_mm_movemask_epi8(_mm_cmpgt_epi32(_mm_set1_epi32(s->best), score)) == 0) continue;
    alignas(16) int scores[4];
    _mm_store_si128(reinterpret_cast<__m128i*>(scores), score);
    for (std::size_t i = 0; i < 4 && k + i < count; ++i) s->offer(scores[i], corners[k + i]);
  }
}

#endif  // PARALLAX_X86

inline int ceil_to_int(float v) {
  const int i = static_cast<int>(v);
  return i + (static_cast<float>(i) < v);
}
inline int floor_to_int(float v) {
  const int i = static_cast<int>(v);
  return i - (static_cast<float>(i) > v);
}

}  // namespace

int zmssd_scalar(const PatchTemplate& t, const GreyImage& image, int x, int y) {
  return zmssd_block_scalar(t.pixels.data(), image.ptr(y - kBlock) + (x - kBlock), image.step[0]);
}

int zmssd(const PatchTemplate& t, const GreyImage& image, int x, int y) {
#if PARALLAX_X86
  const std::uint8_t* block = image.ptr(y - kBlock) + (x - kBlock);
  const SimdLevel level = simd_level();
  if (level >= SimdLevel::kAvx2) return zmssd_block_avx2(t, block, image.step[0]);
  if (level == SimdLevel::kSse2) return zmssd_block_sse2(t.pixels.data(), block, image.step[0]);
#endif
  return zmssd_scalar(t, image, x, y);
}

int best_zmssd(const PatchTemplate& t, const GreyImage& image, const CornerList& corners, double cx, double cy,
               double radius, int threshold, int* best_x, int* best_y) {
  SelectColumns select_columns = select_columns_scalar;
  Evaluate evaluate = evaluate_scalar;
#if PARALLAX_X86
  const SimdLevel level = simd_level();
  if (level >= SimdLevel::kAvx2) {
    select_columns = select_columns_avx2;
    evaluate = evaluate_avx2;
  } else if (level == SimdLevel::kSse2) {
    evaluate = evaluate_sse2;
  }
#endif
  Search search{t, image, threshold == INT_MAX ? INT_MAX : threshold + 1};
  // Written so that NaN fails; beyond 16 bits there are no corners.
  if (!(radius >= 0 && std::abs(cx) <= INT16_MAX && std::abs(cy) <= INT16_MAX)) return search.best;
  radius = std::min(radius, 4.0 * INT16_MAX);
  const float centre_x = static_cast<float>(cx), centre_y = static_cast<float>(cy), r = static_cast<float>(radius);
  const int first_row = std::max(kBlock, ceil_to_int(centre_y - r));
  const int last_row =
      std::min({image.rows - kBlock, static_cast<int>(corners.rows.size()) - 2, floor_to_int(centre_y + r)});
  const Corner* list = corners.corners.data();
  const Corner* end_of_list = list + corners.corners.size();
  Corner queue[kQueueSize + kQueueSlack];
  std::size_t queued = 0;
  for (int y = first_row; y <= last_row; ++y) {
    const Corner* begin = list + corners.rows[static_cast<std::size_t>(y)];
    const Corner* end = list + corners.rows[static_cast<std::size_t>(y) + 1];
    if (begin == end) continue;
    const float dy = static_cast<float>(y) - centre_y, half = std::sqrt(std::max(0.0f, r * r - dy * dy));
    const int first = std::max(kBlock, ceil_to_int(centre_x - half));
    const int last = std::min(image.cols - kBlock, floor_to_int(centre_x + half));
    while (begin < end) {
      const std::size_t step = std::min(kQueueSize, static_cast<std::size_t>(end - begin));
      if (queued + step > kQueueSize) {
        evaluate(queue, queued, &search);
        queued = 0;
      }
      queued += select_columns(begin, begin + step, end_of_list, first, last, queue + queued);
      begin += step;
    }
  }
  if (queued > 0) evaluate(queue, queued, &search);
  if (search.found) {
    *best_x = search.best_corner.x;
    *best_y = search.best_corner.y;
  }
  return search.best;
}

}  // namespace parallax
