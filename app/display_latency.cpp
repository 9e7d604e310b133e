#include "app/display_latency.h"

#include <algorithm>

namespace parallax {
namespace {

constexpr double kSmoothing = 0.1;
// A frame older than this is not of the same clock, or of a program that was stopped.
constexpr double kOldest_s = 1.0;

}  // namespace

double DisplayLatency::take(Timestamp frame_time, double tracking_s, Timestamp now) {
  const Timestamp behind = now - frame_time;
  const double behind_s = to_seconds(behind);
  exact_ = behind_s >= 0 && behind_s <= kOldest_s;
  if (exact_) {
    age_s_ = behind_s;
    fastest_.reset();
  } else {
    const bool other_clock = !fastest_ || to_seconds(behind - *fastest_) > kOldest_s;
    if (other_clock || behind < *fastest_) {
      fastest_ = behind;
      fastest_tracking_s_ = tracking_s;
    }
    age_s_ = std::max(tracking_s, to_seconds(behind - *fastest_) + fastest_tracking_s_);
  }
  taken_ = now;
  horizon_s_ = age_s_ + drawing_s_;
  return horizon_s_;
}

void DisplayLatency::shown(Timestamp now) {
  if (!taken_) return;
  const double drawn_s = std::clamp(to_seconds(now - *taken_), 0.0, kOldest_s);
  taken_.reset();
  drawing_s_ += kSmoothing * (drawn_s - drawing_s_);
  const double whole_s = age_s_ + drawn_s;
  measured_s_ = measured_s_ > 0 ? measured_s_ + kSmoothing * (whole_s - measured_s_) : whole_s;
}

}  // namespace parallax
