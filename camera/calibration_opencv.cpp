// OpenCV's FileStorage files (as its calibration programs write them) and ROS camera_info, as a file of
// camera_calibration_parsers or as the message printed.
#include <algorithm>

#include "camera/calibration_formats.h"

namespace parallax::calibration {
namespace {

// The first of the spellings that is there.
std::string spelling(const CalibrationNode& root, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (root.has(key)) return key;
  return *keys.begin();
}

}  // namespace

bool is_opencv(const CalibrationNode& root) {
  return root.has("camera_matrix") || root.has("Camera_Matrix") ||
         ((root.has("K") || root.has("k")) && root.has("width"));
}

CameraModel read_opencv(const CalibrationNode& root, const Request& request) {
  require_single_camera(request);
  const std::string matrix_key = spelling(root, {"camera_matrix", "Camera_Matrix", "K", "k"});
  const std::string distortion_key = spelling(root, {"distortion_coefficients", "Distortion_Coefficients", "D", "d"});
  const std::vector<double> k = root.numbers(matrix_key, 9, "9 (a 3x3 matrix)");
  for (const std::size_t i : {1U, 3U, 6U, 7U})
    if (k[i] != 0) root.fail(matrix_key, "an entry off the places of fx, fy, cx and cy that is not zero", "no skew");
  if (k[8] != 1) root.fail(matrix_key, "a last entry that is not 1", "1");
  if (!(k[0] > 0 && k[4] > 0)) root.fail(matrix_key, "a focal length that is not positive", "a positive one");

  Intrinsics in;
  in.width = root.image_side_or(spelling(root, {"image_width", "image_Width", "width"}), request.width);
  in.height = root.image_side_or(spelling(root, {"image_height", "image_Height", "height"}), request.height);
  in.fx = k[0];
  in.fy = k[4];
  in.cx = k[2];
  in.cy = k[5];

  std::vector<double> d;
  if (root.has(distortion_key)) d = root.numbers(distortion_key);
  std::string model = root.has("distortion_model") ? root.text("distortion_model") : "";
  if (model.empty() && root.has("fisheye_model") && root.number("fisheye_model") != 0) model = "fisheye";
  if (model == "fisheye" || model == "equidistant") {
    if (d.size() != 4) root.fail(distortion_key, std::to_string(d.size()) + " numbers", "4 (k1 k2 k3 k4)");
    return make_camera(root.file(), CameraModelKind::kannala_brandt, in, d);
  }
  if (!model.empty() && model != "plumb_bob" && model != "rational_polynomial" && model != "none")
    root.fail("distortion_model", "plumb_bob, rational_polynomial, equidistant or fisheye");
  if (d.empty()) return make_camera(root.file(), CameraModelKind::pinhole, in, {});
  if (d.size() == 12 || d.size() == 14) {
    // Thin prism and tilt: none of our models, unless they are zero.
    if (std::any_of(d.begin() + 8, d.end(), [](double value) { return value != 0; }))
      root.fail(distortion_key, "a thin-prism or tilted-sensor term", "at most 8 parameters that are not zero");
    d.resize(8);
  }
  if (d.size() != 4 && d.size() != 5 && d.size() != 8)
    root.fail(distortion_key, std::to_string(d.size()) + " numbers", "0, 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6)");
  return make_radtan(root.file(), in, std::move(d));
}

}  // namespace parallax::calibration
