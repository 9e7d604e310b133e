// What `parallax calibrate` was asked for.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/model_selection.h"
#include "calib/target.h"
#include "camera/calibration_file.h"

namespace parallax {

struct CalibrateSettings {
  std::vector<std::string> sources;  // one folder, video, camera or pattern; or image files
  std::vector<std::string> stereo;   // left and right
  CalibrationTarget target;
  CalibrationRequest request;
  std::string take = "auto";  // which frames: all, chosen (still, sharp and new), auto
  int max_views = 40;         // of chosen frames
  double live_seconds = 120;  // a live camera is watched so long at most
  std::string output, report, plots, euroc;
  CalibrationFormat format = CalibrationFormat::parallax;

  std::string print_target, paper = "a4";  // --print-target
  bool square_given = false;

  std::string convert;  // --convert
  std::optional<LensModel> convert_model;
  int width = 0, height = 0, camera_index = 0;
};

}  // namespace parallax
