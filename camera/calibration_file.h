// Reads calibrations: our YAML, Kalibr camchain, OpenCV / ROS camera_info, ORB-SLAM settings and PTAM camera.cfg, told
// apart by what is in the file; writes our YAML. Pixel conventions are converted to ours (pixel centres at integers).
#pragma once

#include <string>

#include "core/camera_model.h"

namespace parallax {

// The calibration of one camera. Throws InputError ("FILE: key K: found X, expected Y") for anything unusable.
// `camera_index` picks from files that hold several (Kalibr cam0, cam1...).
// `width`, `height`: the size of the images, for formats that state none (PTAM camera.cfg) or in relative units; 0:
// unknown.
CameraModel read_calibration(const std::string& path, int camera_index = 0, int width = 0, int height = 0);

// The same from text already in memory; `name` is used in messages. The fuzz target enters here.
CameraModel parse_calibration(const std::string& text, const std::string& name, int camera_index = 0, int width = 0,
                              int height = 0);

// Our own YAML, written beside and renamed. Throws RunError when it cannot be written.
void write_calibration(const CameraModel& camera, const std::string& path);
std::string format_calibration(const CameraModel& camera);

}  // namespace parallax
