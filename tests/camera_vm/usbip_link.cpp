#include "tests/camera_vm/usbip_link.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace parallax::camera_vm {
namespace {

constexpr char kController[] = "/sys/devices/platform/vhci_hcd.0/";
constexpr int kPort = 0;
constexpr std::uint32_t kDeviceId = 1 << 16 | 2;  // bus 1, device 2: any will do
constexpr int kHighSpeed = 3;

constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitReply = 3, kUnlinkReply = 4;
constexpr std::int32_t kStall = -EPIPE, kUnlinked = -ECONNRESET;

// The 48 bytes that begin every message; numbers in network order.
struct Header {
  std::uint32_t command, sequence, device, direction, endpoint;
  std::array<std::uint32_t, 5> arguments;
  std::array<std::uint8_t, 8> setup;
};
static_assert(sizeof(Header) == 48);

bool write_text(const std::string& file, const std::string& text) {
  const int fd = ::open((kController + file).c_str(), O_WRONLY);
  if (fd < 0) return false;
  const bool done = ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  ::close(fd);
  return done;
}

[[noreturn]] void fail(const char* what) {
  std::perror(what);
  std::exit(2);
}

std::uint16_t little16(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>(bytes[0] | static_cast<unsigned>(bytes[1]) << 8);
}

}  // namespace

UsbIpLink::~UsbIpLink() {
  if (socket_ >= 0) ::close(socket_);
}

void UsbIpLink::plug_in() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) fail("socketpair");
  const std::string attach = std::to_string(kPort) + " " + std::to_string(ends[0]) + " " + std::to_string(kDeviceId) +
                             " " + std::to_string(kHighSpeed);
  // After a detach the port is free only once the driver has torn the old device down.
  constexpr int tries = 100, pause_ms = 100;
  bool attached = false;
  for (int i = 0; i < tries && !attached; ++i) {
    attached = write_text("attach", attach);
    if (!attached) ::poll(nullptr, 0, pause_ms);
  }
  if (!attached) fail("attaching to vhci_hcd");
  ::close(ends[0]);  // the driver holds its own reference
  if (socket_ >= 0) ::close(socket_);
  socket_ = ends[1];
  closed_ = false;
  pending_.clear();
}

void UsbIpLink::pull_out() {
  if (!write_text("detach", std::to_string(kPort))) fail("detaching from vhci_hcd");
  ::close(socket_);
  socket_ = -1;
}

bool UsbIpLink::serve(const std::function<bool()>& unplug) {
  using std::chrono::steady_clock;
  while (!closed_) {
    answer_bulk();
    if (unplug()) return true;
    int wait_ms = -1;
    if (!pending_.empty()) {
      const auto wait =
          std::chrono::duration_cast<std::chrono::milliseconds>(device_.next_bulk() - steady_clock::now());
      wait_ms = static_cast<int>(std::max<long>(0, wait.count() + 1));
    }
    pollfd ready{socket_, POLLIN, 0};
    if (::poll(&ready, 1, wait_ms) > 0 && !handle_request()) return false;
  }
  return false;
}

void UsbIpLink::answer_bulk() {
  while (!pending_.empty() && !closed_) {
    const Bytes data = device_.bulk_in(pending_.front().length);
    if (data.empty()) return;
    reply(pending_.front().sequence, 0, data, static_cast<std::uint32_t>(data.size()));
    pending_.pop_front();
  }
}

bool UsbIpLink::handle_request() {
  Header header{};
  if (!receive(&header, sizeof header)) return false;
  const std::uint32_t command = ntohl(header.command), sequence = ntohl(header.sequence);
  if (command == kUnlink) {
    handle_unlink(sequence, ntohl(header.arguments[0]));
    return true;
  }
  if (command != kSubmit) fail("a request that is not understood");
  const bool in = ntohl(header.direction) == 1;
  const std::uint32_t length = ntohl(header.arguments[1]);
  Bytes out;
  if (!in && length > 0) {
    out.resize(length);
    if (!receive(out.data(), out.size())) return false;
  }
  if (ntohl(header.endpoint) != 0) {
    pending_.push_back({sequence, length});
    return true;
  }
  const auto* setup = header.setup.data();
  const SetupPacket packet{setup[0], setup[1], little16(setup + 2), little16(setup + 4), little16(setup + 6)};
  ControlAnswer answer = device_.control(packet, out);
  if (answer.data.size() > length) answer.data.resize(length);
  const auto sent = static_cast<std::uint32_t>(in ? answer.data.size() : out.size());
  reply(sequence, answer.stall ? kStall : 0, in ? answer.data : Bytes(), sent);
  return true;
}

void UsbIpLink::handle_unlink(std::uint32_t sequence, std::uint32_t target) {
  const auto found =
      std::find_if(pending_.begin(), pending_.end(), [target](const auto& bulk) { return bulk.sequence == target; });
  std::int32_t status = 0;
  if (found != pending_.end()) {
    pending_.erase(found);
    status = kUnlinked;
  }
  Header header{};
  header.command = htonl(kUnlinkReply);
  header.sequence = htonl(sequence);
  header.arguments[0] = htonl(static_cast<std::uint32_t>(status));
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&header);
  send(Bytes(bytes, bytes + sizeof header));
}

void UsbIpLink::reply(std::uint32_t sequence, std::int32_t status, const Bytes& data, std::uint32_t length) {
  Header header{};
  header.command = htonl(kSubmitReply);
  header.sequence = htonl(sequence);
  header.arguments[0] = htonl(static_cast<std::uint32_t>(status));
  header.arguments[1] = htonl(length);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&header);
  Bytes message(bytes, bytes + sizeof header);
  message.insert(message.end(), data.begin(), data.end());
  send(message);
}

bool UsbIpLink::receive(void* data, std::size_t size) {
  auto* at = static_cast<std::uint8_t*>(data);
  while (size > 0) {
    const ssize_t got = ::recv(socket_, at, size, 0);
    if (got <= 0) {
      closed_ = true;
      return false;
    }
    at += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

bool UsbIpLink::send(const Bytes& data) {
  for (std::size_t done = 0; done < data.size();) {
    const ssize_t sent = ::send(socket_, data.data() + done, data.size() - done, MSG_NOSIGNAL);
    if (sent <= 0) {
      closed_ = true;
      return false;
    }
    done += static_cast<std::size_t>(sent);
  }
  return true;
}

}  // namespace parallax::camera_vm
