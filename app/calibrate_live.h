// Views of a calibration target from a live camera: taken by themselves while the user is told what is wanted next.
#pragma once

#include <functional>
#include <string>

#include "calib/calibration_session.h"
#include "camera/live_camera.h"

namespace parallax {

struct LiveGatheringOptions {
  CalibrationTarget target;
  int most_views = 40;
  double seconds = 120;  // looked so long at most, time without a camera included
  // True from the moment the user wants to end; asked from another thread. Empty: never.
  std::function<bool()> ended;
  // Takes one line for the user. Called from one thread at a time, not always the same.
  std::function<void(const std::string&)> say;
};

struct LiveGathering {
  CalibrationData data;
  int frames = 0;  // looked at
};

// Until there are views enough, the time is up, the user ends it or frames come no more; the views taken until then are
// in the result. A camera that is unplugged is told about ("camera disconnected...") and waited for. Stops the camera
// at the end. Throws InputError for a target that makes no sense; `options.say` has to be there.
LiveGathering gather_live_views(LiveCamera* camera, const LiveGatheringOptions& options);

}  // namespace parallax
