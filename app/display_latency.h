// How long it takes from a picture's capture until it is seen, for poses that are predicted to that moment.
//
// Time stamps of frames may be of any clock. Of a clock that is the program's own (V4L2, libcamera: monotonic) the age
// of a frame is exact; of another the fastest frame so far is taken to have come at once, so that what the camera
// itself takes is not counted. No clock of its own: `now` is SteadyClock's time since its epoch. One thread.
#pragma once

#include <optional>

#include "core/time.h"

namespace parallax {

class DisplayLatency {
 public:
  // A frame is taken up to be drawn; tracking it took so long. Returns horizon_s().
  double take(Timestamp frame_time, double tracking_s, Timestamp now);
  // Its picture was given to the screen. Nothing when none was taken up since.
  void shown(Timestamp now);

  // From the capture of the newest frame to when it will probably be seen: how far ahead its pose is predicted.
  double horizon_s() const { return horizon_s_; }
  // What it was for the frames that were shown, smoothed; 0 before the first.
  double capture_to_display_s() const { return measured_s_; }
  // Whether time stamps are of the program's clock.
  bool exact() const { return exact_; }

 private:
  std::optional<Timestamp> taken_;             // the frame that is being drawn
  std::optional<Timestamp> fastest_;           // now less time stamp, of the fastest frame of another clock
  double fastest_tracking_s_ = 0;              // what tracking took of that
  double age_s_ = 0, horizon_s_ = 0;           // of the newest frame
  double drawing_s_ = 0.016, measured_s_ = 0;  // from taking up to the screen, and the whole, smoothed
  bool exact_ = false;
};

}  // namespace parallax
