// Kalibr's camchain, and the sensor.yaml of EuRoC data sets, which differ in key names only.
#include "camera/calibration_formats.h"

namespace parallax::calibration {
namespace {

CameraModel read_sensor(const CalibrationNode& node) {
  const std::string model = node.text("camera_model");
  if (model != "pinhole")
    node.fail("camera_model", "pinhole (other projections, such as omni, eucm and ds, are not supported)");
  const std::string coefficients = node.either("distortion_coeffs", "distortion_coefficients");
  const std::string distortion = node.has("distortion_model") ? node.text("distortion_model") : "none";
  const std::vector<double> focal = node.numbers("intrinsics", 4, "4 (fx fy cx cy)");
  const std::vector<double> size = node.numbers("resolution", 2, "2 (width height)");
  for (int i = 0; i < 2; ++i)
    if (!(focal[static_cast<std::size_t>(i)] > 0))
      node.fail("intrinsics", "a focal length that is not positive", "a positive one");
  for (const double side : size)
    if (!(side >= 1 && side <= 65536) || side != static_cast<int>(side))
      node.fail("resolution", "a side that is no size", "whole numbers of pixels from 1 to 65536");
  const Intrinsics in{static_cast<int>(size[0]), static_cast<int>(size[1]), focal[0], focal[1], focal[2], focal[3]};

  if (distortion == "none") {
    if (node.has(coefficients))
      for (const double k : node.numbers(coefficients))
        if (k != 0) node.fail(coefficients, "zeros for the distortion model none");
    return make_camera(node.file(), CameraModelKind::pinhole, in, {});
  }
  if (distortion == "radtan" || distortion == "radial-tangential") {
    std::vector<double> d = node.numbers(coefficients);
    if (d.size() != 4 && d.size() != 5 && d.size() != 8)
      node.fail(coefficients, std::to_string(d.size()) + " numbers", "4 (k1 k2 p1 p2), 5 or 8");
    return make_radtan(node.file(), in, std::move(d));
  }
  if (distortion == "equidistant")
    return make_camera(node.file(), CameraModelKind::kannala_brandt, in,
                       node.numbers(coefficients, 4, "4 (k1 k2 k3 k4)"));
  if (distortion == "fov")
    return make_camera(node.file(), CameraModelKind::fov, in, node.numbers(coefficients, 1, "1 (w)"));
  node.fail("distortion_model", "radtan, radial-tangential, equidistant, fov or none");
}

}  // namespace

bool is_kalibr_chain(const CalibrationNode& root) { return root.has("cam0"); }

CameraModel read_kalibr_chain(const CalibrationNode& root, const Request& request) {
  return read_sensor(root.section("cam" + std::to_string(request.camera_index)));
}

bool is_euroc_sensor(const CalibrationNode& root) { return root.has("camera_model"); }

CameraModel read_euroc_sensor(const CalibrationNode& root, const Request& request) {
  require_single_camera(request);
  return read_sensor(root);
}

}  // namespace parallax::calibration
