// Time stamps: nanoseconds since an epoch that belongs to the recording.
#pragma once

#include <chrono>

namespace parallax {

using Timestamp = std::chrono::nanoseconds;
using SteadyClock = std::chrono::steady_clock;

inline double to_seconds(Timestamp t) { return std::chrono::duration<double>(t).count(); }
inline Timestamp from_seconds(double s) {
  return Timestamp(static_cast<Timestamp::rep>(s * 1e9 + (s < 0 ? -0.5 : 0.5)));
}
inline double milliseconds_since(SteadyClock::time_point start) {
  return std::chrono::duration<double, std::milli>(SteadyClock::now() - start).count();
}

}  // namespace parallax
