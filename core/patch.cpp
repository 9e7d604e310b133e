#include "core/patch.h"

#include <cstring>

#include "core/cpu_dispatch.h"
#include "core/intrinsics.h"

namespace parallax {

void finish_template(PatchTemplate* t) {
#if PARALLAX_X86
  const __m128i zero = _mm_setzero_si128();
  __m128i sum = zero, squares = zero;
  for (int k = 0; k < kPatchPixels; k += 16) {
    const __m128i v = _mm_load_si128(reinterpret_cast<const __m128i*>(t->pixels.data() + k));
    const __m128i low = _mm_unpacklo_epi8(v, zero), high = _mm_unpackhi_epi8(v, zero);
    sum = _mm_add_epi32(sum, _mm_sad_epu8(v, zero));
    squares = _mm_add_epi32(squares, _mm_add_epi32(_mm_madd_epi16(low, low), _mm_madd_epi16(high, high)));
  }
  squares = _mm_add_epi32(squares, _mm_shuffle_epi32(squares, 0x4e));
  squares = _mm_add_epi32(squares, _mm_shuffle_epi32(squares, 0xb1));
  t->sum = _mm_cvtsi128_si32(_mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4e)));
  t->sum_squares = _mm_cvtsi128_si32(squares);
#else
  t->sum = 0;
  t->sum_squares = 0;
  for (const std::uint8_t p : t->pixels) {
    t->sum += p;
    t->sum_squares += p * p;
  }
#endif
}

bool copy_patch(const GreyImage& source, int x, int y, PatchTemplate* out) {
  constexpr int kHalf = kPatchSize / 2;
  if (x < kHalf || y < kHalf || x > source.cols - kHalf || y > source.rows - kHalf) return false;
  for (int j = 0; j < kPatchSize; ++j) {
    std::memcpy(out->pixels.data() + j * kPatchSize, source.ptr(y - kHalf + j) + (x - kHalf), kPatchSize);
  }
  finish_template(out);
  return true;
}

}  // namespace parallax
