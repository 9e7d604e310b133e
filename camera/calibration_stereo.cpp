// Calibrations of rigs: the two cameras by the readers of the single formats, and where the right one is.
#include "camera/calibration_file.h"
#include "camera/calibration_formats.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

using calibration::is_kalibr_chain;
using calibration::is_orb_slam;
using calibration::is_parallax;

// ORB-SLAM: the right camera's pose, or a baseline of a rectified pair, in metres or times the focal length.
StereoCalibration read_orb_slam_rig(const CalibrationNode& root, const calibration::Request& left) {
  StereoCalibration rig;
  rig.left = rig.right = calibration::read_orb_slam(root, left);
  if (root.has("Stereo.T_c1_c2")) {
    calibration::Request right = left;
    right.camera_index = 1;
    rig.right = calibration::read_orb_slam(root, right);
    rig.right_from_left = root.rigid("Stereo.T_c1_c2").inverse();
    return rig;
  }
  if (root.has("LEFT.K") || rig.left.kind() != CameraModelKind::pinhole)
    root.fail("Stereo.T_c1_c2", "the pose of the right camera, or a pair that is rectified already");
  const double baseline =
      root.has("Stereo.b") ? root.positive("Stereo.b") : root.positive("Camera.bf") / rig.left.focal_px().x();
  rig.right_from_left.t = {-baseline, 0, 0};
  return rig;
}

}  // namespace

StereoCalibration parse_stereo_calibration(const std::string& text, const std::string& name, int width, int height) {
  StereoCalibration rig;
  rig.left = parse_calibration(text, name, 0, width, height);  // and all that is wrong with the text itself
  const calibration::Request request{name, 0, width, height};
  const std::string one_camera = name +
                                 ": found the calibration of one camera, expected a rig's: Right.from_left, cam1 with "
                                 "its T_cn_cnm1, or ORB-SLAM's stereo settings";
  if (calibration::read_ptam(text, request) || calibration::read_kitti(text, request)) throw InputError(one_camera);
  const CalibrationNode root = load_calibration_yaml(text, name);
  if (is_parallax(root)) {
    rig.right = parse_calibration(text, name, 1, width, height);
    rig.right_from_left = root.rigid("Right.from_left");
    return rig;
  }
  if (is_orb_slam(root)) return read_orb_slam_rig(root, request);
  if (is_kalibr_chain(root)) {
    rig.right = parse_calibration(text, name, 1, width, height);
    rig.right_from_left = root.section("cam1").rigid("T_cn_cnm1");
    return rig;
  }
  throw InputError(one_camera);
}

StereoCalibration read_stereo_calibration(const std::string& path, int width, int height) {
  (void)read_calibration(path, 0, width, height);  // folders, pipes and files that are too large
  return parse_stereo_calibration(read_text_file(path), path, width, height);
}

}  // namespace parallax
