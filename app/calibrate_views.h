// Views of a calibration target from whatever a SOURCE of `parallax calibrate` names.
#pragma once

#include <string>
#include <vector>

#include "app/calibrate_settings.h"
#include "calib/calibration_session.h"
#include "calib/stereo_calibration.h"

namespace parallax {

// What was looked at on the way.
struct GatheredViews {
  CalibrationData data;
  int frames = 0;                   // looked at
  std::vector<std::string> unused;  // names of images without the target
};

// From image files, a pattern ("left*.jpg"), a folder, a video, a synthetic sequence or a live camera. Says on stderr
// how far it is, and to a live user what view is wanted. Throws InputError when there is nothing to read, RunError when
// there is no target in it.
GatheredViews gather_views(const CalibrateSettings& settings);

struct GatheredPairs {
  StereoData data;
  int frames = 0;
};
// From two folders, patterns or videos, paired by the frames' numbers (patterns: by place).
GatheredPairs gather_pairs(const CalibrateSettings& settings);

}  // namespace parallax
