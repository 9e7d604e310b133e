// libFuzzer target: what arrives from the network. The first byte picks who reads it: the datagrams' decoder, the
// readers of messages, or the two ends of the protocol.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "sessions/session_client.h"
#include "sessions/session_server.h"

namespace {

using namespace parallax;
using Bytes = std::span<const std::uint8_t>;

void require(bool condition) {
  if (!condition) std::abort();
}

Bytes bytes_of(const std::string& text) { return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}; }

StereoCamera small_camera() { return {16, 16, {20, 20}, {8, 8}, 0.1}; }

// What is taken for a datagram is one: it comes back when it is sent on.
void check_datagram(Bytes bytes) {
  std::string refused;
  const std::optional<Datagram> datagram = decode_datagram(bytes, &refused);
  require(datagram.has_value() == refused.empty());
  if (!datagram) return;
  const std::string again = std::visit([](const auto& d) { return encode(d); }, *datagram);
  require(decode_datagram(bytes_of(again), &refused).has_value());
}

void check_front_end_message(Bytes bytes, bool begun) {
  const StereoCamera camera = small_camera();
  FrontEndMessageReader reader;
  const FrontEndMessage message = reader.read(bytes, begun ? &camera : nullptr);
  ImageCodec codec;
  std::string again;
  if (const auto* m = std::get_if<BeginMessage>(&message)) again = encode(*m);
  if (const auto* m = std::get_if<KeyframeMessage>(&message)) again = encode(*m, &codec);
  if (const auto* m = std::get_if<WindowMessage>(&message)) again = encode(*m);
  if (const auto* m = std::get_if<TimingsMessage>(&message)) again = encode(*m);
  if (const auto* m = std::get_if<EndMessage>(&message)) again = encode(*m);
  reader.read(bytes_of(again), &camera);
}

void check_back_end_message(Bytes bytes) {
  const BackEndMessage message = read_back_end_message(bytes);
  read_back_end_message(bytes_of(std::visit([](const auto& m) { return encode(m); }, message)));
}

// Datagrams one after the other, each behind its length in a byte.
template <class Receive>
void hand_over(Bytes bytes, const Receive& receive) {
  Timestamp now = std::chrono::hours(1);
  while (!bytes.empty()) {
    const std::size_t size = std::min<std::size_t>(bytes[0], bytes.size() - 1);
    receive(bytes.subspan(1, size), now);
    bytes = bytes.subspan(1 + size);
    now += std::chrono::milliseconds(10);
  }
}

void check_server(Bytes bytes) {
  SessionServer server(
      7, {}, [](const std::string&) {}, nullptr, std::chrono::hours(1) - std::chrono::seconds(10));
  server.step(std::chrono::hours(1));
  hand_over(bytes, [&](Bytes datagram, Timestamp now) {
    server.receive(datagram, now);
    while (server.next_job(now)) {
    }
  });
}

void check_client(Bytes bytes) {
  SessionClient client(
      7, {}, [](const std::string&) {}, nullptr);
  SessionStart start;
  start.name = "name";
  start.camera = small_camera();
  client.begin(start, false, std::chrono::hours(1));
  hand_over(bytes, [&](Bytes datagram, Timestamp now) {
    client.receive(datagram, now);
    require(client.due() > now - std::chrono::hours(1));
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const Bytes bytes(data + 1, size - 1);
  try {
    switch (data[0] % 6) {
      case 0:
        check_datagram(bytes);
        break;
      case 1:
        check_front_end_message(bytes, true);
        break;
      case 2:
        check_front_end_message(bytes, false);
        break;
      case 3:
        check_back_end_message(bytes);
        break;
      case 4:
        check_server(bytes);
        break;
      default:
        check_client(bytes);
        break;
    }
  } catch (const InputError& e) {
    require(std::string(e.what()).find('\n') == std::string::npos);
  }
  return 0;
}
