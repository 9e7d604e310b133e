#include "camera/calibration_file.h"

#include <algorithm>
#include <exception>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "camera/calibration_formats.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace calibration {

CameraModel make_camera(const std::string& file, CameraModelKind kind, const Intrinsics& in,
                        const std::vector<double>& distortion) {
  std::array<double, 8> d{};
  std::copy_n(distortion.begin(), std::min<std::size_t>(distortion.size(), 8), d.begin());
  try {
    return CameraModel(kind, in.width, in.height, {in.fx, in.fy}, {in.cx, in.cy}, d,
                       static_cast<int>(distortion.size()));
  } catch (const InputError& error) {
    throw InputError(file + ": " + error.what());
  }
}

CameraModel make_radtan(const std::string& file, const Intrinsics& in, std::vector<double> distortion) {
  if (std::all_of(distortion.begin(), distortion.end(), [](double k) { return k == 0; }))
    return make_camera(file, CameraModelKind::pinhole, in, {});
  return make_camera(file, CameraModelKind::radtan, in, distortion);
}

void require_single_camera(const Request& request) {
  if (request.camera_index != 0)
    throw InputError(request.file + ": camera " + std::to_string(request.camera_index) +
                     ": found one camera only, expected more");
}

}  // namespace calibration

namespace {

constexpr std::size_t largest_file = 1 << 20;  // bytes

[[noreturn]] void refuse_size(const std::string& name) {
  throw InputError(name + ": found more than 1 MB, expected a calibration file");
}

CameraModel parse_text(const std::string& text, const calibration::Request& request) {
  using namespace calibration;
  if (const auto camera = read_ptam(text, request)) return *camera;
  if (const auto camera = read_kitti(text, request)) return *camera;
  const CalibrationNode root = load_calibration_yaml(text, request.file);
  if (is_parallax(root)) return read_parallax(root, request);
  if (is_orb_slam(root)) return read_orb_slam(root, request);
  if (is_kalibr_chain(root)) return read_kalibr_chain(root, request);
  if (is_euroc_sensor(root)) return read_euroc_sensor(root, request);
  if (is_opencv(root)) return read_opencv(root, request);
  throw InputError(request.file +
                   ": found none of the keys Camera.model, Camera.fx, cam0, camera_model, camera_matrix, P0 or "
                   "Camera.Parameters, expected a calibration of a known format");
}

}  // namespace

CameraModel parse_calibration(const std::string& text, const std::string& name, int camera_index, int width,
                              int height) {
  if (camera_index < 0) throw InputError(name + ": camera " + std::to_string(camera_index) + ": expected 0 or more");
  if (text.size() > largest_file) refuse_size(name);
  if (text.find_first_not_of(" \t\r\n") == std::string::npos)
    throw InputError(name + ": found an empty file, expected a calibration");
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte == 0x7f || (byte < 0x20 && c != '\n' && c != '\r' && c != '\t'))
      throw InputError(name + ": found binary data, expected a calibration in text");
  }
  try {
    return parse_text(text, {name, camera_index, width, height});
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {  // whatever a YAML library may still think of
    throw InputError(name + ": found text that cannot be read (" + error.what() + "), expected a calibration");
  }
}

CameraModel read_calibration(const std::string& path, int camera_index, int width, int height) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) throw InputError(path + ": found a folder, expected a calibration file");
  if (!fs::exists(status) || fs::is_regular_file(status)) {
    if (fs::is_regular_file(status) && fs::file_size(path, error) > largest_file && !error) refuse_size(path);
    return parse_calibration(read_text_file(path), path, camera_index, width, height);
  }
  // A pipe or device: never more than the limit.
  std::ifstream stream(path, std::ios::binary);
  std::string text(largest_file + 1, '\0');
  if (!stream) throw InputError(path + ": cannot be read");
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
  return parse_calibration(text, path, camera_index, width, height);
}

}  // namespace parallax
