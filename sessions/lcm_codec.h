// Bytes to generated LCM types and back, for types that begin with their version and then the lengths of their arrays
// (sessions/lcm/*.lcm). The generated decoders trust those lengths; here they are held against the number of bytes
// first.
//
// Only for sources that convert messages: the generated headers go no further. Safe from any thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace parallax::lcm_codec {

inline std::int32_t big_endian_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | bytes[at + i];
  return static_cast<std::int32_t>(value);
}

// Whether the bytes begin with this type's fingerprint.
template <class T>
bool is_a(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 12) return false;
  const std::uint64_t high = static_cast<std::uint32_t>(big_endian_at(bytes, 0));
  const std::uint64_t low = static_cast<std::uint32_t>(big_endian_at(bytes, 4));
  return (high << 32 | low) == static_cast<std::uint64_t>(T::getHash());
}

// `elements`: the encoded size of an element of each array, in the order of their lengths. False unless the bytes are
// exactly one of this type.
template <class T, std::size_t N = 0>
bool decode(std::span<const std::uint8_t> bytes, T* out, const std::array<std::size_t, N>& elements = {}) {
  T empty{};
  std::size_t expected = static_cast<std::size_t>(empty.getEncodedSize());
  if (bytes.size() < expected || bytes.size() > 0x7fffffff) return false;
  for (std::size_t i = 0; i < N; ++i) {
    const std::int32_t length = big_endian_at(bytes, 12 + 4 * i);
    if (length < 0) return false;
    expected += static_cast<std::size_t>(length) * elements[i];
  }
  return expected == bytes.size() &&
         out->decode(bytes.data(), 0, static_cast<int>(bytes.size())) == static_cast<int>(bytes.size());
}

template <class T>
std::string encode(const T& message) {
  std::string bytes(static_cast<std::size_t>(message.getEncodedSize()), '\0');
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

}  // namespace parallax::lcm_codec
