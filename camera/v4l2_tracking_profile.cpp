#include "camera/v4l2_tracking_profile.h"

#include <linux/videodev2.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <sstream>

namespace parallax {
namespace {

constexpr Timestamp kSettle = std::chrono::seconds(1);             // cameras need 0.3 to 0.8 s
constexpr Timestamp kCheckAfter = std::chrono::milliseconds(400);  // a new exposure reaches the frames within 3 to 6
constexpr double kBrightnessFactor = 1.4;                          // above what a scene changes by itself in that time
constexpr double kDarkest = 8;  // grey levels added to both sides: the ratio of two dark pictures says nothing

constexpr double kExposureUnit_s = 1e-4;  // of V4L2_CID_EXPOSURE_ABSOLUTE

double brightness_of(const GreyImage& grey) { return cv::mean(grey)[0]; }

bool automatic_exposure(std::int64_t mode) {
  return mode == V4L2_EXPOSURE_AUTO || mode == V4L2_EXPOSURE_APERTURE_PRIORITY;
}

// Switches an automatic off and keeps the value that it governs at its present one. Nothing when it was not on.
std::optional<std::int64_t> hold(V4l2Controls* controls, std::uint32_t automatic_id, std::int64_t manual,
                                 std::uint32_t value_id) {
  const auto automatic = controls->value(automatic_id);
  if (!automatic || *automatic == manual) return std::nullopt;
  const auto present = controls->value(value_id);
  if (!controls->set(automatic_id, manual)) return std::nullopt;
  if (present) controls->set(value_id, *present);
  return automatic;
}

std::string one_decimal(double value) {
  std::ostringstream text;
  text.precision(1);
  text << std::fixed << value;
  return text.str();
}

}  // namespace

TrackingProfile::TrackingProfile(V4l2Controls* controls) : controls_(controls) {
  if (const auto sharpness = controls_->find(V4L2_CID_SHARPNESS); sharpness && !sharpness->read_only) {
    controls_->set(V4L2_CID_SHARPNESS, sharpness->minimum);
  }
}

std::optional<std::string> TrackingProfile::on_frame(Timestamp time, const GreyImage& grey) {
  if (stage_ == Stage::locked) return std::nullopt;
  if (!first_) first_ = time;
  if (stage_ == Stage::settling) {
    if (time - *first_ < kSettle) return std::nullopt;
    brightness_ = brightness_of(grey);
    lock();
    locked_at_ = time;
    stage_ = exposure_.empty() ? Stage::locked : Stage::checking;
    return std::nullopt;
  }
  if (time - *locked_at_ < kCheckAfter) return std::nullopt;
  stage_ = Stage::locked;
  const double now = brightness_of(grey);
  const double ratio = (now + kDarkest) / (brightness_ + kDarkest);
  if (ratio < kBrightnessFactor && ratio > 1 / kBrightnessFactor) return std::nullopt;
  unlock_exposure();
  return "the exposure cannot be locked (mean grey level went from " + one_decimal(brightness_) + " to " +
         one_decimal(now) + "): left automatic";
}

void TrackingProfile::lock() {
  const auto mode = controls_->value(V4L2_CID_EXPOSURE_AUTO);
  if (mode && automatic_exposure(*mode)) {
    if (hold(controls_, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL, V4L2_CID_EXPOSURE_ABSOLUTE)) {
      exposure_.push_back({V4L2_CID_EXPOSURE_AUTO, *mode});
    }
  }
  if (const auto gain = hold(controls_, V4L2_CID_AUTOGAIN, 0, V4L2_CID_GAIN)) {
    exposure_.push_back({V4L2_CID_AUTOGAIN, *gain});
  }
  hold(controls_, V4L2_CID_AUTO_WHITE_BALANCE, 0, V4L2_CID_WHITE_BALANCE_TEMPERATURE);
  hold(controls_, V4L2_CID_FOCUS_AUTO, 0, V4L2_CID_FOCUS_ABSOLUTE);
}

void TrackingProfile::unlock_exposure() {
  for (auto locked = exposure_.rbegin(); locked != exposure_.rend(); ++locked) {
    controls_->set(locked->id, locked->automatic);
  }
  exposure_.clear();
}

std::string slow_reason(const V4l2Controls& controls, double measured_fps, double requested_fps) {
  constexpr double slow = 0.9;  // of what was asked for
  if (measured_fps <= 0 || requested_fps <= 0 || measured_fps >= slow * requested_fps) return "";
  const auto mode = controls.value(V4L2_CID_EXPOSURE_AUTO);
  const auto may_slow_down = controls.value(V4L2_CID_EXPOSURE_AUTO_PRIORITY);
  if (mode && automatic_exposure(*mode) && may_slow_down.value_or(0) != 0) {
    return "automatic exposure: more light helps (or set exposure_dynamic_framerate to 0)";
  }
  if (const auto time = controls.value(V4L2_CID_EXPOSURE_ABSOLUTE)) {
    const double exposure_s = static_cast<double>(*time) * kExposureUnit_s;
    if (exposure_s > 1 / requested_fps) {
      return "exposure time of " + std::to_string(std::lround(exposure_s * 1e3)) +
             " ms: more light, or a shorter exposure_time_absolute, helps";
    }
  }
  return "";
}

}  // namespace parallax
