#include "camera/live_frame_rate.h"

namespace parallax {
namespace {

constexpr Timestamp kWindow = std::chrono::seconds(1);

}  // namespace

void FrameRateMeter::add(Timestamp time, std::uint64_t lost) {
  if (!marks_.empty() && time <= marks_.back().time) marks_.clear();  // another clock: begin anew
  marks_.push_back({time, marks_.empty() ? 0 : marks_.back().count + 1 + lost});
  // The oldest one kept is the youngest that is a window old, so that slow cameras are measured too.
  while (marks_.size() > 2 && time - marks_[1].time >= kWindow) marks_.pop_front();
}

double FrameRateMeter::rate() const {
  if (marks_.size() < 2) return 0;
  return static_cast<double>(marks_.back().count - marks_.front().count) /
         to_seconds(marks_.back().time - marks_.front().time);
}

bool FrameRateMeter::is_settled() const {
  return marks_.size() >= 2 && marks_.back().time - marks_.front().time >= kWindow;
}

}  // namespace parallax
