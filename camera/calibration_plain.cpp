// Formats that are lines of text: PTAM's camera.cfg and KITTI's calib.txt.
#include <array>

#include "camera/calibration_formats.h"
#include "core/error.h"
#include "core/parse_text.h"

namespace parallax::calibration {
namespace {

[[noreturn]] void fail(const Request& request, const std::string& key, const std::string& found,
                       const std::string& expected) {
  throw InputError(request.file + ": key " + key + ": found " + found + ", expected " + expected);
}

void require_size(const Request& request, const std::string& key) {
  if (request.width < 1 || request.height < 1)
    fail(request, key, "no image size in this format", "the width and height of the images to be known beforehand");
}

std::vector<double> read_numbers(const Request& request, const std::string& key, std::string_view text) {
  std::vector<std::string_view> fields;
  split_blanks(text, &fields);
  std::vector<double> values;
  for (const std::string_view field : fields) {
    double value = 0;
    if (!parse_number(field, &value)) fail(request, key, in_quotes(field), "a finite number");
    values.push_back(value);
  }
  return values;
}

}  // namespace

std::optional<CameraModel> read_ptam(std::string_view text, const Request& request) {
  const std::string key = "Camera.Parameters";
  LineReader lines(text);
  std::string_view line, value;
  bool found = false;
  while (lines.next(&line)) {
    if (!line.starts_with(key)) continue;
    const std::string_view rest = trimmed(line.substr(key.size()));
    if (!rest.starts_with("=")) continue;
    value = trimmed(rest.substr(1));
    found = true;  // the last assignment counts
  }
  if (!found) return std::nullopt;
  require_single_camera(request);
  if (value.ends_with(";")) value = trimmed(value.substr(0, value.size() - 1));
  if (!value.starts_with("[") || !value.ends_with("]") || value.size() < 2)
    fail(request, key, in_quotes(value), "[ fx fy cx cy w ]");
  const std::vector<double> p = read_numbers(request, key, value.substr(1, value.size() - 2));
  if (p.size() != 5) fail(request, key, std::to_string(p.size()) + " numbers", "5 ([ fx fy cx cy w ])");
  if (!(p[0] > 0 && p[1] > 0)) fail(request, key, "a focal length that is not positive", "a positive one");
  require_size(request, key);
  // In units of the image size, which is measured from the corner of the corner pixel: its centre is at half a pixel.
  const Intrinsics in{request.width,
                      request.height,
                      p[0] * request.width,
                      p[1] * request.height,
                      p[2] * request.width - 0.5,
                      p[3] * request.height - 0.5};
  return make_camera(request.file, CameraModelKind::fov, in, {p[4]});
}

std::optional<CameraModel> read_kitti(std::string_view text, const Request& request) {
  // The projection matrix of a rectified camera, row by row: P0: fx 0 cx tx 0 fy cy ty 0 0 1 tz.
  bool is_kitti = false;
  std::string_view value, line;
  std::string key = "P";
  key += std::to_string(request.camera_index);
  bool found = false;
  for (LineReader lines(text); lines.next(&line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) continue;
    const std::string_view name = trimmed(line.substr(0, colon));
    is_kitti = is_kitti || name == "P0";
    if (name != key || found) continue;
    found = true;
    value = line.substr(colon + 1);
  }
  if (!is_kitti) return std::nullopt;
  if (!found) fail(request, key, "nothing", "a projection matrix of 12 numbers");
  const std::vector<double> p = read_numbers(request, key, value);
  if (p.size() != 12) fail(request, key, std::to_string(p.size()) + " numbers", "12 (a 3x4 projection matrix)");
  for (const std::size_t i : {1U, 4U, 8U, 9U})
    if (p[i] != 0) fail(request, key, "a projection with skew or rotation", "that of a rectified camera");
  if (p[10] != 1) fail(request, key, "an eleventh number that is not 1", "1");
  if (!(p[0] > 0 && p[5] > 0)) fail(request, key, "a focal length that is not positive", "a positive one");
  require_size(request, key);
  return make_camera(request.file, CameraModelKind::pinhole, {request.width, request.height, p[0], p[5], p[2], p[6]},
                     {});
}

}  // namespace parallax::calibration
