#include "sessions/lcm_bus.h"

#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <random>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

constexpr const char* kToBackEnd = "PARALLAX_B";
constexpr const char* kToFrontEnds = "PARALLAX_F";
constexpr long kReceiveBuffer = 4 << 20;  // bytes: with less, bursts are lost while the machine is busy
constexpr int kMostAtOnce = 256;          // datagrams that wait() returns

struct Address {
  std::string group;
  int port = 0;
};

[[noreturn]] void refuse(const std::string& url, const std::string& found, const std::string& expected) {
  throw InputError("--lcm " + url + ": found " + found + ", expected " + expected);
}

Address parse_address(const std::string& url) {
  const std::string scheme = "udpm://", form = "udpm://GROUP:PORT, as " + std::string(kDefaultLcmUrl);
  if (!url.starts_with(scheme)) refuse(url, "another kind of address", form);
  const std::string rest = url.substr(scheme.size(), url.find('?') - scheme.size());
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string::npos) refuse(url, "no port", form);
  Address out;
  out.group = rest.substr(0, colon);
  const char* end = rest.data() + rest.size();
  const auto [stop, error] = std::from_chars(rest.data() + colon + 1, end, out.port);
  if (error != std::errc() || stop != end || out.port < 1 || out.port > 65535)
    refuse(url, "port '" + rest.substr(colon + 1) + "'", "1 to 65535");
  in_addr address{};
  if (inet_pton(AF_INET, out.group.c_str(), &address) != 1 || !IN_MULTICAST(ntohl(address.s_addr)))
    refuse(url, "group '" + out.group + "'", "a multicast address, 224.0.0.0 to 239.255.255.255");
  return out;
}

// LCM says what is missing on stderr, in a box of many lines; this is asked before.
void check_route(const std::string& url, const Address& address) {
  const int socket_fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_fd < 0) throw RunError("--lcm " + url + ": " + std::strerror(errno));
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(address.port));
  inet_pton(AF_INET, address.group.c_str(), &to.sin_addr);
  const bool reached = connect(socket_fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  const int error = errno;
  close(socket_fd);
  if (!reached)
    refuse(url, std::string("no way to it (") + std::strerror(error) + ")",
           "a multicast route: ip link set lo up; ip route add " + address.group + "/32 dev lo");
}

// What the kernel grants without a complaint of LCM.
long receive_buffer() {
  long most = kReceiveBuffer;
  std::ifstream("/proc/sys/net/core/rmem_max") >> most;
  return std::clamp(most, 65536L, kReceiveBuffer);
}

}  // namespace

std::string complete_lcm_url(const std::string& url) {
  parse_address(url);
  std::string out = url;
  const auto has = [&](const std::string& key) {
    const std::size_t query = url.find('?');
    return query != std::string::npos && (url.find("?" + key + "=", query) != std::string::npos ||
                                          url.find("&" + key + "=", query) != std::string::npos);
  };
  const auto append = [&](const std::string& setting) {
    out += (out.find('?') == std::string::npos ? '?' : '&') + setting;
  };
  if (!has("ttl")) append("ttl=0");
  if (!has("recv_buf_size")) append("recv_buf_size=" + std::to_string(receive_buffer()));
  return out;
}

std::int64_t random_identity() {
  std::random_device device;
  return std::uniform_int_distribution<std::int64_t>(1)(device);
}

Timestamp steady_now() { return std::chrono::duration_cast<Timestamp>(SteadyClock::now().time_since_epoch()); }

struct LcmBus::Implementation {
  std::string url;
  const char* channel = nullptr;  // of the other side
  lcm_t* lcm = nullptr;
  int wake_fd = -1;
  std::vector<std::vector<std::uint8_t>> arrived;

  ~Implementation() {
    if (lcm) lcm_destroy(lcm);
    if (wake_fd >= 0) close(wake_fd);
  }
  static void take(const lcm_recv_buf_t* buffer, const char*, void* self) {
    const auto* bytes = static_cast<const std::uint8_t*>(buffer->data);
    static_cast<Implementation*>(self)->arrived.emplace_back(bytes, bytes + buffer->data_size);
  }
};

LcmBus::LcmBus(const std::string& url, LcmSide side) : implementation_(std::make_unique<Implementation>()) {
  Implementation& i = *implementation_;
  i.url = complete_lcm_url(url);
  check_route(url, parse_address(url));
  i.channel = side == LcmSide::front_end ? kToBackEnd : kToFrontEnds;
  i.wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  i.lcm = lcm_create(i.url.c_str());
  if (i.wake_fd < 0 || !i.lcm) refuse(url, "an address that LCM cannot use", "one of this machine's networks");
  // The back end hears other back ends too.
  const auto hear = [&](const char* channel) {
    lcm_subscription_t* subscription = lcm_subscribe(i.lcm, channel, &Implementation::take, &i);
    if (!subscription) refuse(url, "an address that LCM cannot listen on", "one of this machine's networks");
    lcm_subscription_set_queue_capacity(subscription, 0);  // no limit but LCM's own
  };
  hear(kToFrontEnds);
  if (side == LcmSide::back_end) hear(kToBackEnd);
}

LcmBus::~LcmBus() = default;

const std::string& LcmBus::url() const { return implementation_->url; }

void LcmBus::send(const std::string& datagram) {
  // What cannot be sent is lost, as it may be on the way.
  lcm_publish(implementation_->lcm, implementation_->channel, datagram.data(),
              static_cast<unsigned int>(datagram.size()));
}

void LcmBus::wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(implementation_->wake_fd, &one, sizeof one);
}

std::vector<std::vector<std::uint8_t>> LcmBus::wait(Timestamp until) {
  Implementation& i = *implementation_;
  const Timestamp left = until == Timestamp::max() ? std::chrono::seconds(1) : until - steady_now();
  const auto ms = std::clamp<std::int64_t>((left.count() + 999'999) / 1'000'000, 0, 1000);
  pollfd files[2] = {{lcm_get_fileno(i.lcm), POLLIN, 0}, {i.wake_fd, POLLIN, 0}};
  poll(files, 2, static_cast<int>(ms));
  if (files[1].revents & POLLIN) {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t got = read(i.wake_fd, &count, sizeof count);
  }
  for (int n = 0; n < kMostAtOnce && lcm_handle_timeout(i.lcm, 0) > 0; ++n) {
  }
  return std::exchange(i.arrived, {});
}

}  // namespace parallax
