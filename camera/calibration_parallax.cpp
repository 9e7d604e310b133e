// Our own YAML, and the settings files of ORB-SLAM2 and 3, which share its key names.
#include <algorithm>
#include <array>

#include "camera/calibration_formats.h"

namespace parallax::calibration {
namespace {

Intrinsics read_intrinsics(const CalibrationNode& root, const std::string& prefix) {
  Intrinsics in;
  in.fx = root.positive(prefix + "fx");
  in.fy = root.positive(prefix + "fy");
  in.cx = root.number(prefix + "cx");
  in.cy = root.number(prefix + "cy");
  return in;
}

std::vector<double> read_keys(const CalibrationNode& root, const std::string& prefix,
                              std::initializer_list<const char*> keys) {
  std::vector<double> values;
  for (const char* key : keys) values.push_back(root.number(prefix + key));
  return values;
}

bool has_any(const CalibrationNode& root, const std::string& prefix, std::initializer_list<const char*> keys) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* key) { return root.has(prefix + key); });
}

// Distortion in OpenCV's order: k1 k2 p1 p2 [k3 [k4 k5 k6]].
std::vector<double> read_radtan_keys(const CalibrationNode& root, const std::string& prefix) {
  std::vector<double> d = read_keys(root, prefix, {"k1", "k2", "p1", "p2"});
  const bool rational = has_any(root, prefix, {"k4", "k5", "k6"});
  if (rational || root.has(prefix + "k3")) d.push_back(root.number(prefix + "k3"));
  if (rational)
    for (const double k : read_keys(root, prefix, {"k4", "k5", "k6"})) d.push_back(k);
  return d;
}

}  // namespace

bool is_parallax(const CalibrationNode& root) { return root.has("Camera.model"); }

CameraModel read_parallax(const CalibrationNode& root, const Request& request) {
  const bool right = request.camera_index == 1 && root.has("Right.model");
  if (!right) require_single_camera(request);
  const std::string p = right ? "Right." : "Camera.", model = root.text(p + "model");
  CameraModelKind kind{};
  std::vector<std::string> known;
  if (model == "pinhole") {
    kind = CameraModelKind::pinhole;
  } else if (model == "radtan") {
    kind = CameraModelKind::radtan;
    known = {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"};
  } else if (model == "kannala_brandt") {
    kind = CameraModelKind::kannala_brandt;
    known = {"k1", "k2", "k3", "k4"};
  } else if (model == "fov") {
    kind = CameraModelKind::fov;
    known = {"omega"};
  } else {
    root.fail(p + "model", "pinhole, radtan, kannala_brandt or fov");
  }
  // A parameter that the model would pass over in silence is a mistake.
  for (const char* key : {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "omega"})
    if (root.has(p + key) && std::find(known.begin(), known.end(), key) == known.end())
      root.fail(p + key, "no such parameter of the model " + model);

  Intrinsics in = read_intrinsics(root, p);
  in.width = root.image_side(p + "width");
  in.height = root.image_side(p + "height");
  std::vector<double> d;
  if (kind == CameraModelKind::radtan) d = read_radtan_keys(root, p);
  if (kind == CameraModelKind::kannala_brandt) d = read_keys(root, p, {"k1", "k2", "k3", "k4"});
  if (kind == CameraModelKind::fov) d = read_keys(root, p, {"omega"});
  return make_camera(root.file(), kind, in, d);
}

bool is_orb_slam(const CalibrationNode& root) { return has_any(root, "", {"Camera.fx", "Camera1.fx", "Camera.type"}); }

CameraModel read_orb_slam(const CalibrationNode& root, const Request& request) {
  // Version 3 numbers its cameras from 1 and states the type; version 2 knows one camera, a pinhole.
  std::string p = "Camera.";
  if (root.has("Camera1.fx") || request.camera_index > 0) p = "Camera" + std::to_string(request.camera_index + 1) + ".";
  const std::string type = root.has("Camera.type") ? root.text("Camera.type") : "PinHole";
  Intrinsics in = read_intrinsics(root, p);
  in.width = root.image_side_or("Camera.width", request.width);
  in.height = root.image_side_or("Camera.height", request.height);
  if (type == "Rectified") return make_camera(root.file(), CameraModelKind::pinhole, in, {});
  if (type == "KannalaBrandt8")
    return make_camera(root.file(), CameraModelKind::kannala_brandt, in, read_keys(root, p, {"k1", "k2", "k3", "k4"}));
  if (type != "PinHole" && type != "Pinhole") root.fail("Camera.type", "PinHole, KannalaBrandt8 or Rectified");
  if (!has_any(root, p, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}))
    return make_camera(root.file(), CameraModelKind::pinhole, in, {});
  return make_radtan(root.file(), in, read_radtan_keys(root, p));
}

}  // namespace parallax::calibration
