// What a person at the desk is told while there is no map yet (PTAM §6.1): how far the camera has been moved, and what
// to do next. Pure.
#pragma once

#include <string>

#include "core/camera_model.h"
#include "tracker/tracking_types.h"

namespace parallax {

enum class HintKind {
  none,        // tracking, or lost: another hint is shown
  hold_still,  // before the first key press
  refused,     // the last try came to nothing, and why
  slide,       // moving, not far enough yet
  turning,     // the camera is turned, not moved
  losing,      // patches are getting lost
  ready,       // far enough: press the key
  working,     // the mapper is making the map
};

struct InitialisationHint {
  HintKind kind = HintKind::none;
  std::string text;         // one sentence, ASCII
  double parallax_deg = 0;  // between the two sights of the same places, median; 0 while only turning
  double gauge = 0;         // 0..1: 1 is enough
  int patches = 0;          // still followed
};

struct HintOptions {
  // The frames are chosen by the program: no key is asked for, and a try that was refused is followed by the next.
  bool automatic = false;
  std::string key = "Space";
  // Half the angle of 10 cm at 60 cm, about what a slide across a desk gives. The solver needs 1 degree at the least;
  // more parallax makes a better first map.
  double enough_deg = 5;
  int few_patches = 80;  // fewer are followed: about to be lost
};

// `message`: what was last refused (ViewMemory::message()); empty: nothing.
InitialisationHint initialisation_hint(const CameraModel& camera, const TrackingResult& tracked,
                                       const std::string& message, const HintOptions& options = {});

// Median displacement of the trails as an angle; what is left of it when the rotation that explains the most has been
// taken away; and what is left when the camera's own rotation has, as the homography of the table gives it (Ma et al.,
// An Invitation to 3-D Vision, 5.3.3). Degrees; zero for fewer than 8 trails.
struct TrailMotion {
  double median_deg = 0;
  double beyond_rotation_deg = 0;
  double parallax_deg = 0;  // noise alone gives some: of use where beyond_rotation_deg says that the camera moved
};
TrailMotion trail_motion(const CameraModel& camera, const std::vector<std::array<Eigen::Vector2f, 2>>& trails);

}  // namespace parallax
