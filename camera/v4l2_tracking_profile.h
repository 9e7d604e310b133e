// Holds a camera still for tracking: automatic exposure, gain, white balance and focus are let settle for about a
// second and are then locked where they are, and sharpening is turned off, so that a patch looks the same from frame to
// frame. What the driver cannot lock stays as it is.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera/v4l2_controls.h"
#include "core/image.h"

namespace parallax {

// One thread. Changes go through V4l2Controls, which puts them back.
class TrackingProfile {
 public:
  // `controls` outlives the profile. Turns sharpening off at once.
  explicit TrackingProfile(V4l2Controls* controls);

  // To be told of every frame delivered; returns a line for the user when there is something to say. Some cameras
  // report an exposure they do not use: when the picture gets much brighter or darker by locking, the exposure goes
  // back to automatic.
  std::optional<std::string> on_frame(Timestamp time, const GreyImage& grey);

  bool is_locked() const { return stage_ == Stage::locked; }

 private:
  enum class Stage { settling, checking, locked };
  void lock();
  void unlock_exposure();

  V4l2Controls* controls_;
  Stage stage_ = Stage::settling;
  std::optional<Timestamp> first_, locked_at_;
  double brightness_ = 0;  // mean grey level before locking
  struct Locked {
    std::uint32_t id;
    std::int64_t automatic;
  };
  std::vector<Locked> exposure_;  // what locks exposure and gain, and its automatic value
};

// Why frames come more slowly than asked, as far as the controls tell ("" when they do not).
std::string slow_reason(const V4l2Controls& controls, double measured_fps, double requested_fps);

}  // namespace parallax
