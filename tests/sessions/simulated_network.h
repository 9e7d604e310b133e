// Datagrams between two sides on a simulated clock: lost, doubled, late and out of order as a seeded generator says.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/time.h"

namespace parallax::testing {

struct NetworkWeather {
  double loss = 0, doubled = 0;
  Timestamp delay = std::chrono::microseconds(200), jitter{0};
};

class SimulatedNetwork {
 public:
  SimulatedNetwork(const NetworkWeather& weather, std::uint64_t seed) : weather_(weather), rng_(seed) {}

  void send(bool to_back_end, const std::string& datagram, Timestamp now) {
    ++sent_;
    std::uniform_real_distribution<double> uniform;
    const int copies = uniform(rng_) < weather_.doubled ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
      if (uniform(rng_) < weather_.loss) continue;
      const auto late = static_cast<Timestamp::rep>(uniform(rng_) * static_cast<double>(weather_.jitter.count()));
      flying_.emplace(now + weather_.delay + Timestamp(late), std::pair(to_back_end, datagram));
    }
  }
  Timestamp due() const { return flying_.empty() ? Timestamp::max() : flying_.begin()->first; }
  // What has arrived on that side by now.
  std::vector<std::string> take(bool at_back_end, Timestamp now) {
    std::vector<std::string> out;
    for (auto it = flying_.begin(); it != flying_.end() && it->first <= now;)
      if (it->second.first == at_back_end) {
        out.push_back(std::move(it->second.second));
        it = flying_.erase(it);
      } else {
        ++it;
      }
    return out;
  }
  int sent() const { return sent_; }

 private:
  NetworkWeather weather_;
  std::mt19937_64 rng_;
  std::multimap<Timestamp, std::pair<bool, std::string>> flying_;
  int sent_ = 0;
};

inline std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

inline const NetworkWeather kGoodWeather{};
inline const NetworkWeather kRoughWeather{0.05, 0, std::chrono::milliseconds(50), std::chrono::milliseconds(2)};
inline const NetworkWeather kStormyWeather{0.2, 0.1, std::chrono::milliseconds(10), std::chrono::milliseconds(40)};

}  // namespace parallax::testing
