// The frame rate of a camera as it is, over about the last second.
#pragma once

#include <cstdint>
#include <deque>

#include "core/time.h"

namespace parallax {

// Not thread-safe.
class FrameRateMeter {
 public:
  // A frame that came at `time` (of the driver, increasing), `lost` frames after the one before it.
  void add(Timestamp time, std::uint64_t lost = 0);
  // Frames a second, lost ones included; 0 until two frames have come.
  double rate() const;
  // At least a second of frames has been seen.
  bool is_settled() const;

 private:
  struct Mark {
    Timestamp time;
    std::uint64_t count;  // of frames up to here
  };
  std::deque<Mark> marks_;
};

}  // namespace parallax
