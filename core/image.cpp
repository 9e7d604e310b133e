#include "core/image.h"

#include <cstdint>

#include "core/check.h"
#include "core/cpu_dispatch.h"
#include "core/intrinsics.h"

namespace parallax {
namespace {

// Each kernel averages two rows into one, out[x] = (a[2x] + a[2x+1] + b[2x] + b[2x+1] + 2) / 4.
using HalveRow = void (*)(const std::uint8_t* a, const std::uint8_t* b, std::uint8_t* out, int width);

inline void halve_from(int x, const std::uint8_t* a, const std::uint8_t* b, std::uint8_t* out, int width) {
  for (; x < width; ++x) {
    out[x] = static_cast<std::uint8_t>((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
  }
}

#if PARALLAX_X86

void halve_row_sse2(const std::uint8_t* a, const std::uint8_t* b, std::uint8_t* out, int width) {
  const __m128i low = _mm_set1_epi16(0x00ff), two = _mm_set1_epi16(2);
  const auto sums = [&](int x) {
    const __m128i p = _mm_loadu_si128(reinterpret_cast<const __m128i*>(a + x));
    const __m128i q = _mm_loadu_si128(reinterpret_cast<const __m128i*>(b + x));
    const __m128i s = _mm_add_epi16(_mm_add_epi16(_mm_and_si128(p, low), _mm_srli_epi16(p, 8)),
                                    _mm_add_epi16(_mm_and_si128(q, low), _mm_srli_epi16(q, 8)));
    return _mm_srli_epi16(_mm_add_epi16(s, two), 2);
  };
  int x = 0;
  for (; x + 16 <= width; x += 16) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + x), _mm_packus_epi16(sums(2 * x), sums(2 * x + 16)));
  }
  halve_from(x, a, b, out, width);
}

PARALLAX_TARGET_AVX2 inline __m256i pair_sums(const std::uint8_t* a, const std::uint8_t* b) {
  const __m256i ones = _mm256_set1_epi8(1);
  const __m256i p = _mm256_maddubs_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(a)), ones);
  const __m256i q = _mm256_maddubs_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(b)), ones);
  return _mm256_srli_epi16(_mm256_add_epi16(_mm256_add_epi16(p, q), _mm256_set1_epi16(2)), 2);
}

PARALLAX_TARGET_AVX2 void halve_row_avx2(const std::uint8_t* a, const std::uint8_t* b, std::uint8_t* out, int width) {
  int x = 0;
  for (; x + 32 <= width; x += 32) {
    const __m256i packed =
        _mm256_packus_epi16(pair_sums(a + 2 * x, b + 2 * x), pair_sums(a + 2 * x + 32, b + 2 * x + 32));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + x), _mm256_permute4x64_epi64(packed, 0xd8));
  }
  halve_from(x, a, b, out, width);
}

PARALLAX_TARGET_AVX512 void halve_row_avx512(const std::uint8_t* a, const std::uint8_t* b, std::uint8_t* out,
                                             int width) {
  const __m512i ones = _mm512_set1_epi8(1), two = _mm512_set1_epi16(2);
  int x = 0;
  for (; x + 32 <= width; x += 32) {
    const __m512i p = _mm512_maddubs_epi16(_mm512_loadu_si512(a + 2 * x), ones);
    const __m512i q = _mm512_maddubs_epi16(_mm512_loadu_si512(b + 2 * x), ones);
    const __m512i s = _mm512_srli_epi16(_mm512_add_epi16(_mm512_add_epi16(p, q), two), 2);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + x), _mm512_cvtepi16_epi8(s));
  }
  halve_from(x, a, b, out, width);
}

#endif  // PARALLAX_X86

void halve_row_scalar(const std::uint8_t* a, const std::uint8_t* b, std::uint8_t* out, int width) {
  halve_from(0, a, b, out, width);
}

HalveRow halve_row() {
#if PARALLAX_X86
  switch (simd_level()) {
    case SimdLevel::kAvx512:
      return halve_row_avx512;
    case SimdLevel::kAvx2:
      return halve_row_avx2;
    case SimdLevel::kSse2:
      return halve_row_sse2;
    case SimdLevel::kScalar:
      break;
  }
#endif
  return halve_row_scalar;
}

// True when `image` owns its pixels alone, so that they may be overwritten without another holder seeing it.
bool sole_owner(const GreyImage& image) { return image.u != nullptr && image.u->refcount == 1; }

}  // namespace

void build_pyramid(const GreyImage& level0, ImagePyramid* pyramid) {
  PARALLAX_CHECK(pyramid != nullptr, "build_pyramid needs a pyramid to fill");
  const HalveRow halve = halve_row();
  pyramid->level[0] = level0;
  for (int l = 1; l < kPyramidLevels; ++l) {
    const GreyImage& from = pyramid->level[static_cast<std::size_t>(l - 1)];
    GreyImage& to = pyramid->level[static_cast<std::size_t>(l)];
    if (!sole_owner(to) || to.data == from.data) to = GreyImage();
    to.create(from.rows / 2, from.cols / 2);
    for (int y = 0; y < to.rows; ++y) halve(from.ptr(2 * y), from.ptr(2 * y + 1), to.ptr(y), to.cols);
  }
}

}  // namespace parallax
