#include "sessions/stream_datagrams.h"

#include <algorithm>
#include <parallax_messages/piece.hpp>
#include <parallax_messages/presence.hpp>
#include <parallax_messages/probe.hpp>
#include <parallax_messages/receipt.hpp>

#include "core/checksum.h"
#include "sessions/lcm_codec.h"

namespace parallax {
namespace {

constexpr std::int64_t kMostNumber = std::int64_t{1} << 48;  // of a piece: years of streaming

template <class T>
void put_address(const StreamAddress& address, T* message) {
  message->version = kSessionProtocolVersion;
  message->from = address.from;
  message->to = address.to;
  message->stream = address.stream;
}

template <class T>
StreamAddress address_of(const T& message) {
  return {message.from, message.to, message.stream};
}

bool is_sound(const StreamAddress& address) { return address.from > 0 && address.to > 0 && address.stream > 0; }

std::int64_t sum_of(std::int64_t number, const void* data, std::size_t size) {
  return static_cast<std::int64_t>(checksum(data, size, static_cast<std::uint64_t>(number)));
}

// False: it was none of this type, or of another version; `refused` says so then.
template <class T, std::size_t N = 0>
bool read_as(std::span<const std::uint8_t> bytes, T* message, std::string* refused,
             const std::array<std::size_t, N>& elements = {}) {
  if (lcm_codec::decode(bytes, message, elements) && message->version == kSessionProtocolVersion) return true;
  const std::int32_t version = lcm_codec::big_endian_at(bytes, 8);
  *refused = std::string(T::getTypeName()) + " datagram: found ";
  *refused += version != kSessionProtocolVersion
                  ? "version " + std::to_string(version) + ", expected " + std::to_string(kSessionProtocolVersion)
                  : std::to_string(bytes.size()) + " bytes, expected as many as its lengths say";
  return false;
}

std::optional<Datagram> refuse(const char* type, const char* what, std::string* refused) {
  *refused = std::string(type) + " datagram: found " + what;
  return std::nullopt;
}

}  // namespace

std::string encode(const Presence& presence) {
  parallax_messages::presence out{};
  out.version = kSessionProtocolVersion;
  out.back_end = presence.back_end;
  out.running = presence.running;
  out.front_ends = presence.front_ends;
  return lcm_codec::encode(out);
}

std::string encode(const Probe& probe) {
  parallax_messages::probe out{};
  put_address(probe.address, &out);
  return lcm_codec::encode(out);
}

std::string encode(const Piece& piece) {
  parallax_messages::piece out{};
  put_address(piece.address, &out);
  out.number = piece.number;
  out.first = piece.first;
  out.last = piece.last;
  out.data.assign(piece.data.begin(), piece.data.end());
  out.size = static_cast<std::int32_t>(out.data.size());
  out.checksum = sum_of(piece.number, piece.data.data(), piece.data.size());
  return lcm_codec::encode(out);
}

std::string encode(const Receipt& receipt) {
  parallax_messages::receipt out{};
  put_address(receipt.address, &out);
  out.unknown = receipt.unknown;
  out.next = receipt.next;
  out.limit = receipt.limit;
  out.later.assign((receipt.later.size() + 7) / 8, 0);
  for (std::size_t i = 0; i < receipt.later.size(); ++i)
    if (receipt.later[i]) out.later[i / 8] = static_cast<std::uint8_t>(out.later[i / 8] | 1u << (i % 8));
  out.size = static_cast<std::int32_t>(out.later.size());
  return lcm_codec::encode(out);
}

std::optional<Datagram> decode_datagram(std::span<const std::uint8_t> bytes, std::string* refused) {
  if (lcm_codec::is_a<parallax_messages::piece>(bytes)) {
    parallax_messages::piece in{};
    if (!read_as<parallax_messages::piece, 1>(bytes, &in, refused, {1})) return std::nullopt;
    Piece out{address_of(in), in.number, in.first != 0, in.last != 0, {}};
    if (!is_sound(out.address)) return refuse("piece", "no address", refused);
    if (in.number < 0 || in.number > kMostNumber) return refuse("piece", "a number out of range", refused);
    if (in.size < 1 || in.size > kMostPieceBytes) return refuse("piece", "a length out of range", refused);
    out.data.assign(in.data.begin(), in.data.end());
    if (in.checksum != sum_of(in.number, out.data.data(), out.data.size()))
      return refuse("piece", "damaged data", refused);
    return out;
  }
  if (lcm_codec::is_a<parallax_messages::receipt>(bytes)) {
    parallax_messages::receipt in{};
    if (!read_as<parallax_messages::receipt, 1>(bytes, &in, refused, {1})) return std::nullopt;
    Receipt out{address_of(in), in.unknown != 0, in.next, in.limit, {}};
    if (!is_sound(out.address)) return refuse("receipt", "no address", refused);
    if (in.next < 0 || in.next > kMostNumber || in.limit < in.next || in.limit > in.next + kMostPiecesAhead ||
        in.size > kMostPiecesAhead / 8)
      return refuse("receipt", "numbers out of range", refused);
    out.later.resize(in.later.size() * 8);
    for (std::size_t i = 0; i < out.later.size(); ++i) out.later[i] = (in.later[i / 8] >> (i % 8) & 1) != 0;
    return out;
  }
  if (lcm_codec::is_a<parallax_messages::probe>(bytes)) {
    parallax_messages::probe in{};
    if (!read_as(bytes, &in, refused)) return std::nullopt;
    const Probe out{address_of(in)};
    const bool to_all = in.from > 0 && in.to == 0 && in.stream == 0;
    if (!to_all && !is_sound(out.address)) return refuse("probe", "no address", refused);
    return out;
  }
  if (lcm_codec::is_a<parallax_messages::presence>(bytes)) {
    parallax_messages::presence in{};
    if (!read_as(bytes, &in, refused)) return std::nullopt;
    if (in.back_end <= 0 || in.front_ends < 0) return refuse("presence", "numbers out of range", refused);
    return Presence{in.back_end, in.running != 0, in.front_ends};
  }
  *refused = "datagram: found " + std::to_string(bytes.size()) +
             " bytes of a kind that is not known, expected one of protocol version " +
             std::to_string(kSessionProtocolVersion);
  return std::nullopt;
}

}  // namespace parallax
