// The readers of the single calibration formats, and what they share. Internal to camera/calibration_file.
// All throw InputError; none knows a file system.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "camera/calibration_node.h"
#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax::calibration {

// What the caller knows besides the text.
struct Request {
  std::string file;           // for messages
  int camera_index = 0;       // of those in the file
  int width = 0, height = 0;  // of the images, 0: unknown
};

// Focal lengths and principal point, already in our pixel convention.
struct Intrinsics {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

// A camera of the given kind; messages of the model get the file's name. A radtan lens without distortion becomes a
// pinhole.
CameraModel make_camera(const std::string& file, CameraModelKind kind, const Intrinsics& intrinsics,
                        const std::vector<double>& distortion);
CameraModel make_radtan(const std::string& file, const Intrinsics& intrinsics, std::vector<double> distortion);

// Refuses any camera but the first, for files that hold one.
void require_single_camera(const Request& request);

// Formats that are YAML, and how to know them.
bool is_parallax(const CalibrationNode& root);      // Camera.model
bool is_orb_slam(const CalibrationNode& root);      // Camera.fx or Camera1.fx
bool is_kalibr_chain(const CalibrationNode& root);  // cam0
bool is_euroc_sensor(const CalibrationNode& root);  // camera_model with intrinsics
bool is_opencv(const CalibrationNode& root);        // camera_matrix, or K with width (ROS camera_info)
CameraModel read_parallax(const CalibrationNode& root, const Request& request);
CameraModel read_orb_slam(const CalibrationNode& root, const Request& request);
CameraModel read_kalibr_chain(const CalibrationNode& root, const Request& request);
CameraModel read_euroc_sensor(const CalibrationNode& root, const Request& request);
CameraModel read_opencv(const CalibrationNode& root, const Request& request);

// Formats that are lines of text: nothing when the text is not of the format.
std::optional<CameraModel> read_ptam(std::string_view text, const Request& request);
std::optional<CameraModel> read_kitti(std::string_view text, const Request& request);

}  // namespace parallax::calibration
