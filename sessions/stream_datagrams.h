// The datagrams that carry streams of messages between front ends and the back end (sessions/lcm/stream.lcm): as plain
// values, and as the bytes that LCM carries.
//
// Bytes may come from anywhere. What is not exactly a datagram of this version, with every number in its bounds, is
// refused with a reason; nothing is allocated beyond the length of what came. Plain functions, safe from any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace parallax {

inline constexpr int kSessionProtocolVersion = 1;

inline constexpr int kMostPieceBytes = 16384;  // of a piece's data, as received
inline constexpr int kMostPiecesAhead = 512;   // of the first that is missing

// Who says it, to whom (identities are random and above 0), and in which of their streams, from 1.
struct StreamAddress {
  std::int64_t from = 0, to = 0;
  std::int32_t stream = 0;
  bool operator==(const StreamAddress&) const = default;
};

struct Presence {
  std::int64_t back_end = 0;
  bool running = false;
  int front_ends = 0;
};
struct Probe {
  StreamAddress address;  // `to` 0: any back end; stream 0 then
};
struct Piece {
  StreamAddress address;
  std::int64_t number = 0;
  bool first = false, last = false;
  std::string data;
};
struct Receipt {
  StreamAddress address;
  bool unknown = false;
  std::int64_t next = 0, limit = 0;
  std::vector<bool> later;  // of next + 1, next + 2...: has arrived
};
using Datagram = std::variant<Presence, Probe, Piece, Receipt>;

std::string encode(const Presence& presence);
std::string encode(const Probe& probe);
std::string encode(const Piece& piece);
std::string encode(const Receipt& receipt);

// Nothing, and `refused` says why, when it is none.
std::optional<Datagram> decode_datagram(std::span<const std::uint8_t> bytes, std::string* refused);

// Sends the bytes of a datagram; may lose them.
using SendDatagram = std::function<void(const std::string&)>;

}  // namespace parallax
