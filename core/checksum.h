// A 64-bit checksum of bytes: eight at a time, multiplied and folded. Finds damage and differences; keeps no secrets.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace parallax {

// Continues from `seed`, so that parts may be summed one after the other; how the bytes are cut up matters.
inline std::uint64_t checksum(const void* data, std::size_t size, std::uint64_t seed = 0) {
  constexpr std::uint64_t kOdd = 0x9e3779b97f4a7c15ULL;  // 2^64 over the golden ratio
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::uint64_t sum = (seed ^ size) * kOdd;
  const auto mix = [&](std::uint64_t word) {
    sum = (sum ^ word) * kOdd;
    sum ^= sum >> 29;
  };
  for (; size >= 8; bytes += 8, size -= 8) {
    std::uint64_t word;
    std::memcpy(&word, bytes, 8);
    mix(word);
  }
  std::uint64_t last = 0;
  if (size > 0) std::memcpy(&last, bytes, size);
  mix(last);
  return sum ^ (sum >> 32);
}

}  // namespace parallax
