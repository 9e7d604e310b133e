// LCM, as far as sessions need it: datagrams on one address, to front ends or to the back end.
//
// Datagrams stay on this machine unless the address says otherwise: `ttl=0` is added to one without a ttl. send() and
// wake() may be called from any thread; wait() belongs to one.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/time.h"

namespace parallax {

inline constexpr const char* kDefaultLcmUrl = "udpm://239.255.76.67:7667";

enum class LcmSide { front_end, back_end };

// The address in full: with a ttl and the size of the receive buffer. Throws InputError when it is none that can be
// used between processes.
std::string complete_lcm_url(const std::string& url);

// Random, above 0, from the operating system's generator.
std::int64_t random_identity();

class LcmBus {
 public:
  // Hears what is sent to `side`. Throws InputError when the address cannot be used on this machine, and says what to
  // do.
  LcmBus(const std::string& url, LcmSide side);
  ~LcmBus();
  LcmBus(const LcmBus&) = delete;
  LcmBus& operator=(const LcmBus&) = delete;

  // To the other side; may be lost.
  void send(const std::string& datagram);
  // Until something has arrived, wake() was called, or it is `until` (of a steady clock). What has arrived.
  std::vector<std::vector<std::uint8_t>> wait(Timestamp until);
  void wake();

  const std::string& url() const;

  struct Implementation;

 private:
  std::unique_ptr<Implementation> implementation_;
};

// Time of the steady clock, as the protocol wants it.
Timestamp steady_now();

}  // namespace parallax
