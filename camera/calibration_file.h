// Reads calibrations: our YAML, Kalibr camchain, OpenCV / ROS camera_info, ORB-SLAM settings and PTAM camera.cfg, told
// apart by what is in the file; writes all of them. Pixel conventions are converted to ours (pixel centres at
// integers).
#pragma once

#include <string>

#include "camera/stereo_source.h"
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

// The forms other programs read.
enum class CalibrationFormat { parallax, kalibr, opencv, ros, orb_slam, ptam };
// "parallax", "kalibr", "opencv", "ros", "orbslam", "ptam". The first throws InputError for any other name.
CalibrationFormat calibration_format(const std::string& name);
const char* to_string(CalibrationFormat format);

// Empty when the format can hold the camera's model; else which it can hold ("fov", "pinhole, radtan4 or
// kannala_brandt").
std::string format_problem(const CameraModel& camera, CalibrationFormat format);

// The text of a file; reads back to the same camera (PTAM's form: to the last bits of a rescaled number). `name` is the
// camera's, for forms that want one. Throws InputError when the format cannot hold the model.
std::string format_calibration(const CameraModel& camera, CalibrationFormat format, const std::string& name = "camera");
void write_calibration(const CameraModel& camera, CalibrationFormat format, const std::string& path);

// A rig: our own YAML (the left camera as `Camera.`, the right one as `Right.`, and `Right.from_left`, the upper three
// rows of right_from_left, row by row, metres), Kalibr's camchain (cam0, cam1 and its T_cn_cnm1) or the stereo settings
// of ORB-SLAM3 (Camera1, Camera2, Stereo.T_c1_c2; or a rectified pair with Camera.bf or Stereo.b). read_calibration
// reads either camera by its index; these read the whole, and throw as it does.
StereoCalibration read_stereo_calibration(const std::string& path, int width = 0, int height = 0);
StereoCalibration parse_stereo_calibration(const std::string& text, const std::string& name, int width = 0,
                                           int height = 0);
void write_stereo_calibration(const StereoCalibration& rig, const std::string& path);
std::string format_stereo_calibration(const StereoCalibration& rig);

// The sensor.yaml of a camera in an EuRoC recording, which the stereo reader takes: `body_from_camera` is its T_BS.
std::string format_euroc_sensor(const CameraModel& camera, const RigidTransform& body_from_camera, double rate_hz);

}  // namespace parallax
