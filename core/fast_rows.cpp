#include "core/fast_rows.h"

#include "core/cpu_dispatch.h"
#include "core/intrinsics.h"

namespace parallax::detail {
namespace {

// True when `mask`'s 16 bits, taken as a ring, hold 10 set ones in a row.
inline bool has_run_of_ten(unsigned mask) {
  const unsigned ring = mask | mask << 16;
  const unsigned two = ring & ring >> 1, four = two & two >> 2, eight = four & four >> 4;
  return (eight & two >> 8 & 0xffffu) != 0;
}

inline Corner* scalar_range(const std::uint8_t* row, std::ptrdiff_t stride, int first, int last, int y, int threshold,
                            Corner* out) {
  for (int x = first; x < last; ++x) {
    const std::uint8_t* p = row + x;
    const int high = *p + threshold, low = *p - threshold;
    const int top = p[-3 * stride], right = p[3], bottom = p[3 * stride], left = p[-3];
    const bool may_be_bright = (top > high || bottom > high) && (left > high || right > high);
    const bool may_be_dark = (top < low || bottom < low) && (left < low || right < low);
    if (!may_be_bright && !may_be_dark) continue;
    unsigned bright = 0, dark = 0;
    for (unsigned k = 0; k < 16; ++k) {
      const int v = p[kFastCircle[k].y * stride + kFastCircle[k].x];
      bright |= static_cast<unsigned>(v > high) << k;
      dark |= static_cast<unsigned>(v < low) << k;
    }
    if (has_run_of_ten(bright) || has_run_of_ten(dark)) {
      *out++ = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)};
    }
  }
  return out;
}

}  // namespace

Corner* fast_row_scalar(const std::uint8_t* row, std::size_t stride, int width, int y, int threshold, Corner* out) {
  return scalar_range(row, static_cast<std::ptrdiff_t>(stride), 3, width - 3, y, threshold, out);
}

#if PARALLAX_X86
namespace {

// Writes a corner for every set bit of `mask`, bit 0 being column x.
template <typename Mask>
inline Corner* emit(Mask mask, int x, int y, Corner* out) {
  for (std::uint64_t left = mask; left != 0; left &= left - 1) {
    *out++ = {static_cast<std::int16_t>(x + __builtin_ctzll(left)), static_cast<std::int16_t>(y)};
  }
  return out;
}

inline std::uint16_t nonzero_sse2(__m128i v) {
  return static_cast<std::uint16_t>(~_mm_movemask_epi8(_mm_cmpeq_epi8(v, _mm_setzero_si128())));
}

#define FAST_NAME(name) name##_sse2
#define FAST_TARGET
#define FAST_VECTOR __m128i
#define FAST_MASK std::uint16_t
#define FAST_WIDTH 16
#define FAST_LOAD(p) _mm_loadu_si128(reinterpret_cast<const __m128i*>(p))
#define FAST_SET1 _mm_set1_epi8
#define FAST_MIN _mm_min_epu8
#define FAST_MAX _mm_max_epu8
#define FAST_ADDS _mm_adds_epu8
#define FAST_SUBS _mm_subs_epu8
#define FAST_OR _mm_or_si128
#define FAST_NONZERO nonzero_sse2
#define FAST_EMIT emit
#define FAST_NARROWER fast_row_scalar
#include "core/fast_kernel.inc"

PARALLAX_TARGET_AVX2 inline std::uint32_t nonzero_avx2(__m256i v) {
  return ~static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(v, _mm256_setzero_si256())));
}

#define FAST_NAME(name) name##_avx2
#define FAST_TARGET PARALLAX_TARGET_AVX2
#define FAST_VECTOR __m256i
#define FAST_MASK std::uint32_t
#define FAST_WIDTH 32
#define FAST_LOAD(p) _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p))
#define FAST_SET1 _mm256_set1_epi8
#define FAST_MIN _mm256_min_epu8
#define FAST_MAX _mm256_max_epu8
#define FAST_ADDS _mm256_adds_epu8
#define FAST_SUBS _mm256_subs_epu8
#define FAST_OR _mm256_or_si256
#define FAST_NONZERO nonzero_avx2
#define FAST_EMIT emit
#define FAST_NARROWER fast_row_sse2
#include "core/fast_kernel.inc"

PARALLAX_TARGET_AVX512 inline std::uint64_t nonzero_avx512(__m512i v) { return _mm512_test_epi8_mask(v, v); }

// As emit(), 16 columns at a time; may write up to 15 corners of scratch behind the end.
PARALLAX_TARGET_AVX512 inline Corner* emit_avx512(std::uint64_t mask, int x, int y, Corner* out) {
  const __m512i lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  __m512i corners = _mm512_add_epi32(lanes, _mm512_set1_epi32((y << 16) + x));
  for (; mask != 0; mask >>= 16) {
    const auto part = static_cast<__mmask16>(mask & 0xffff);
    _mm512_storeu_si512(out, _mm512_maskz_compress_epi32(part, corners));
    out += __builtin_popcount(part);
    corners = _mm512_add_epi32(corners, _mm512_set1_epi32(16));
  }
  return out;
}

#define FAST_NAME(name) name##_avx512
#define FAST_TARGET PARALLAX_TARGET_AVX512
#define FAST_VECTOR __m512i
#define FAST_MASK std::uint64_t
#define FAST_WIDTH 64
#define FAST_LOAD(p) _mm512_loadu_si512(p)
#define FAST_SET1 _mm512_set1_epi8
#define FAST_MIN _mm512_min_epu8
#define FAST_MAX _mm512_max_epu8
#define FAST_ADDS _mm512_adds_epu8
#define FAST_SUBS _mm512_subs_epu8
#define FAST_OR _mm512_or_si512
#define FAST_NONZERO nonzero_avx512
#define FAST_EMIT emit_avx512
#define FAST_NARROWER fast_row_avx2
#include "core/fast_kernel.inc"

}  // namespace
#endif  // PARALLAX_X86

FastRow fast_row() {
#if PARALLAX_X86
  switch (simd_level()) {
    case SimdLevel::kAvx512:
      return fast_row_avx512;
    case SimdLevel::kAvx2:
      return fast_row_avx2;
    case SimdLevel::kSse2:
      return fast_row_sse2;
    case SimdLevel::kScalar:
      break;
  }
#endif
  return fast_row_scalar;
}

}  // namespace parallax::detail
