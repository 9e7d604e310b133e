#include "tracker/tracking_types.h"

namespace parallax {

const char* to_string(TrackingState state) {
  switch (state) {
    case TrackingState::waiting:
      return "waiting";
    case TrackingState::trailing:
      return "trailing";
    case TrackingState::initialising:
      return "initialising";
    case TrackingState::tracking:
      return "tracking";
    case TrackingState::lost:
      return "lost";
  }
  return "?";
}

const char* to_string(TrackingQuality quality) {
  switch (quality) {
    case TrackingQuality::lost:
      return "lost";
    case TrackingQuality::poor:
      return "poor";
    case TrackingQuality::good:
      return "good";
  }
  return "?";
}

}  // namespace parallax
