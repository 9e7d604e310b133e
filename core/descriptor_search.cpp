#include "core/descriptor_search.h"

#include <algorithm>

#include "core/cpu_dispatch.h"
#include "core/intrinsics.h"

namespace parallax {

DescriptorSet::DescriptorSet(std::span<const BinaryDescriptor> descriptors)
    : blocks_((descriptors.size() + kBlock - 1) / kBlock), size_(static_cast<int>(descriptors.size())) {
  for (std::size_t p = 0; p < blocks_.size() * kBlock; ++p) {
    const BinaryDescriptor& d = descriptors[std::min(p, descriptors.size() - 1)];
    Block& block = blocks_[p / kBlock];
    for (std::size_t w = 0; w < 4; ++w) block.word[w][p % 4][p % kBlock / 4] = d.bits[w];
  }
}

int DescriptorSet::distances(const BinaryDescriptor& query, std::vector<std::uint16_t>* distances) const {
  distances->resize(blocks_.size() * kBlock);
  if (blocks_.empty()) return 257;
  const auto scan = simd_level() >= SimdLevel::kAvx512 ? scan_avx512
                    : simd_level() >= SimdLevel::kAvx2 ? scan_avx2
                                                       : scan_scalar;
  return scan(blocks_.data(), blocks_.size(), query, distances->data());
}

int DescriptorSet::scan_scalar(const Block* blocks, std::size_t n, const BinaryDescriptor& query, std::uint16_t* out) {
  int least = 257;
  for (const Block* b = blocks; b != blocks + n; ++b) {
    for (int p = 0; p < kBlock; ++p) {
      int distance = 0;
      for (int w = 0; w < 4; ++w) distance += std::popcount(b->word[w][p % 4][p / 4] ^ query.bits[w]);
      least = std::min(least, distance);
      *out++ = static_cast<std::uint16_t>(distance);
    }
  }
  return least;
}

#if PARALLAX_X86
// Bits are counted by looking up the two halves of each byte (Mula); four words of a descriptor add up to at most 32 in
// a byte before the bytes are summed. The sums of the four groups k are shifted into one 64-bit lane, which puts them
// in order.
PARALLAX_TARGET_AVX2 int DescriptorSet::scan_avx2(const Block* blocks, std::size_t n, const BinaryDescriptor& query,
                                                  std::uint16_t* out) {
  const __m256i table = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4));
  const __m256i half = _mm256_set1_epi8(15), zero = _mm256_setzero_si256();
  __m256i q[4];
  for (int w = 0; w < 4; ++w) q[w] = _mm256_set1_epi64x(static_cast<long long>(query.bits[w]));
  __m256i least = _mm256_set1_epi16(257);
  for (const Block* b = blocks; b != blocks + n; ++b) {
    for (int h = 0; h < 2; ++h, out += 16) {
      __m256i all = zero;
      for (int k = 3; k >= 0; --k) {
        __m256i sum = zero;
        for (int w = 0; w < 4; ++w) {
          const __m256i x =
              _mm256_xor_si256(q[w], _mm256_load_si256(reinterpret_cast<const __m256i*>(&b->word[w][k][4 * h])));
          const __m256i low = _mm256_shuffle_epi8(table, _mm256_and_si256(x, half));
          const __m256i high = _mm256_shuffle_epi8(table, _mm256_and_si256(_mm256_srli_epi16(x, 4), half));
          sum = _mm256_add_epi8(sum, _mm256_add_epi8(low, high));
        }
        all = _mm256_or_si256(_mm256_slli_epi64(all, 16), _mm256_sad_epu8(sum, zero));
      }
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), all);
      least = _mm256_min_epu16(least, all);
    }
  }
  const __m128i both = _mm_min_epu16(_mm256_castsi256_si128(least), _mm256_extracti128_si256(least, 1));
  return _mm_extract_epi16(_mm_minpos_epu16(both), 0);
}

PARALLAX_TARGET_AVX512 int DescriptorSet::scan_avx512(const Block* blocks, std::size_t n, const BinaryDescriptor& query,
                                                      std::uint16_t* out) {
  const __m512i table = _mm512_broadcast_i32x4(_mm_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4));
  const __m512i half = _mm512_set1_epi8(15), zero = _mm512_setzero_si512();
  __m512i q[4];
  for (int w = 0; w < 4; ++w) q[w] = _mm512_set1_epi64(static_cast<long long>(query.bits[w]));
  __m512i least = _mm512_set1_epi16(257);
  for (const Block* b = blocks; b != blocks + n; ++b, out += kBlock) {
    __m512i all = zero;
    for (int k = 3; k >= 0; --k) {
      __m512i sum = zero;
      for (int w = 0; w < 4; ++w) {
        const __m512i x = _mm512_xor_si512(q[w], _mm512_load_si512(b->word[w][k]));
        const __m512i low = _mm512_shuffle_epi8(table, _mm512_and_si512(x, half));
        const __m512i high = _mm512_shuffle_epi8(table, _mm512_and_si512(_mm512_srli_epi16(x, 4), half));
        sum = _mm512_add_epi8(sum, _mm512_add_epi8(low, high));
      }
      all = _mm512_or_si512(_mm512_slli_epi64(all, 16), _mm512_sad_epu8(sum, zero));
    }
    _mm512_storeu_si512(out, all);
    least = _mm512_min_epu16(least, all);
  }
  const __m256i four = _mm256_min_epu16(_mm512_castsi512_si256(least), _mm512_extracti64x4_epi64(least, 1));
  const __m128i both = _mm_min_epu16(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
  return _mm_extract_epi16(_mm_minpos_epu16(both), 0);
}
#else
int DescriptorSet::scan_avx2(const Block* blocks, std::size_t n, const BinaryDescriptor& query, std::uint16_t* out) {
  return scan_scalar(blocks, n, query, out);
}
int DescriptorSet::scan_avx512(const Block* blocks, std::size_t n, const BinaryDescriptor& query, std::uint16_t* out) {
  return scan_scalar(blocks, n, query, out);
}
#endif

}  // namespace parallax
