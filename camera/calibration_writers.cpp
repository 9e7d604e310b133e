// Writes calibrations, in our own form and in those of others.
#include <charconv>
#include <initializer_list>
#include <ostream>
#include <sstream>
#include <string_view>
#include <vector>

#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

// The shortest text that reads back to the same value.
std::string exact(double value) {
  char digits[32];
  const auto result = std::to_chars(digits, digits + sizeof digits, value);
  std::string text(digits, result.ptr);
  // OpenCV's parser takes a number without a point for an integer.
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string exact_list(const std::vector<double>& values) {
  std::string text = "[";
  for (std::size_t i = 0; i < values.size(); ++i) text += (i > 0 ? ", " : "") + exact(values[i]);
  return text + "]";
}

std::vector<double> distortion_of(const CameraModel& camera) {
  return {camera.distortion().begin(), camera.distortion().begin() + camera.n_distortion()};
}

std::vector<double> matrix_of(const CameraModel& camera) {
  return {camera.focal_px().x(), 0, camera.centre_px().x(), 0, camera.focal_px().y(), camera.centre_px().y(), 0, 0, 1};
}

void write_parallax_keys(const CameraModel& camera, const std::string& prefix, std::ostream& out) {
  const auto line = [&](const char* key, double value) {
    char digits[32];
    const auto result = std::to_chars(digits, digits + sizeof digits, value);
    out << prefix << key << ": " << std::string_view(digits, static_cast<std::size_t>(result.ptr - digits)) << "\n";
  };
  out << prefix << "model: " << to_string(camera.kind()) << "\n";
  out << prefix << "width: " << camera.width() << "\n" << prefix << "height: " << camera.height() << "\n";
  line("fx", camera.focal_px().x());
  line("fy", camera.focal_px().y());
  line("cx", camera.centre_px().x());
  line("cy", camera.centre_px().y());
  constexpr const char* radtan[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  for (int i = 0; i < camera.n_distortion(); ++i) {
    const double value = camera.distortion()[static_cast<std::size_t>(i)];
    if (camera.kind() == CameraModelKind::fov) line("omega", value);
    if (camera.kind() == CameraModelKind::radtan) line(radtan[i], value);
    if (camera.kind() == CameraModelKind::kannala_brandt) {
      constexpr const char* names[] = {"k1", "k2", "k3", "k4"};
      line(names[i], value);
    }
  }
}

void write_kalibr_keys(const CameraModel& camera, const std::string& indent, const char* coefficients,
                       std::ostream& out) {
  const char* distortion = camera.kind() == CameraModelKind::fov              ? "fov"
                           : camera.kind() == CameraModelKind::kannala_brandt ? "equidistant"
                           : camera.kind() == CameraModelKind::radtan         ? "radtan"
                                                                              : "none";
  out << indent << "camera_model: pinhole\n";
  out << indent << "intrinsics: "
      << exact_list({camera.focal_px().x(), camera.focal_px().y(), camera.centre_px().x(), camera.centre_px().y()})
      << "\n";
  out << indent << "distortion_model: " << distortion << "\n";
  out << indent << coefficients << ": " << exact_list(distortion_of(camera)) << "\n";
  out << indent << "resolution: [" << camera.width() << ", " << camera.height() << "]\n";
}

void write_opencv(const CameraModel& camera, std::ostream& out) {
  const auto matrix = [&](const char* name, int rows, int columns, const std::vector<double>& data) {
    out << name << ": !!opencv-matrix\n   rows: " << rows << "\n   cols: " << columns
        << "\n   dt: d\n   data: " << exact_list(data) << "\n";
  };
  out << "%YAML:1.0\n---\nimage_width: " << camera.width() << "\nimage_height: " << camera.height() << "\n";
  if (camera.kind() == CameraModelKind::kannala_brandt) out << "fisheye_model: 1\n";
  matrix("camera_matrix", 3, 3, matrix_of(camera));
  std::vector<double> d = distortion_of(camera);
  if (d.empty()) d.assign(5, 0.0);
  matrix("distortion_coefficients", static_cast<int>(d.size()), 1, d);
}

void write_ros(const CameraModel& camera, const std::string& name, std::ostream& out) {
  std::vector<double> d = distortion_of(camera);
  const bool fisheye = camera.kind() == CameraModelKind::kannala_brandt;
  if (!fisheye && d.size() < 5) d.resize(5, 0.0);  // plumb_bob has five
  const char* model = fisheye ? "equidistant" : d.size() == 8 ? "rational_polynomial" : "plumb_bob";
  const auto matrix = [&](const char* key, int rows, int columns, const std::vector<double>& data) {
    out << key << ":\n  rows: " << rows << "\n  cols: " << columns << "\n  data: " << exact_list(data) << "\n";
  };
  out << "image_width: " << camera.width() << "\nimage_height: " << camera.height() << "\ncamera_name: " << name
      << "\n";
  matrix("camera_matrix", 3, 3, matrix_of(camera));
  out << "distortion_model: " << model << "\n";
  matrix("distortion_coefficients", 1, static_cast<int>(d.size()), d);
  matrix("rectification_matrix", 3, 3, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  matrix("projection_matrix", 3, 4,
         {camera.focal_px().x(), 0, camera.centre_px().x(), 0, 0, camera.focal_px().y(), camera.centre_px().y(), 0, 0,
          0, 1, 0});
}

void write_orb_slam(const CameraModel& camera, std::ostream& out) {
  const bool fisheye = camera.kind() == CameraModelKind::kannala_brandt;
  out << "%YAML:1.0\n\nFile.version: \"1.0\"\nCamera.type: \"" << (fisheye ? "KannalaBrandt8" : "PinHole") << "\"\n";
  const auto line = [&](const char* key, double value) { out << "Camera1." << key << ": " << exact(value) << "\n"; };
  line("fx", camera.focal_px().x());
  line("fy", camera.focal_px().y());
  line("cx", camera.centre_px().x());
  line("cy", camera.centre_px().y());
  const std::vector<double> d = distortion_of(camera);
  constexpr const char* radtan[] = {"k1", "k2", "p1", "p2", "k3"};
  constexpr const char* kannala_brandt[] = {"k1", "k2", "k3", "k4"};
  for (std::size_t i = 0; i < d.size(); ++i) line(fisheye ? kannala_brandt[i] : radtan[i], d[i]);
  out << "Camera.width: " << camera.width() << "\nCamera.height: " << camera.height() << "\n";
}

void write_ptam(const CameraModel& camera, std::ostream& out) {
  // In units of the image size, from the corner of the corner pixel.
  const double w = camera.width(), h = camera.height();
  out << "Camera.Parameters=[ " << exact(camera.focal_px().x() / w) << " " << exact(camera.focal_px().y() / h) << " "
      << exact((camera.centre_px().x() + 0.5) / w) << " " << exact((camera.centre_px().y() + 0.5) / h) << " "
      << exact(camera.distortion()[0]) << " ]\n";
}

}  // namespace

const char* to_string(CalibrationFormat format) {
  switch (format) {
    case CalibrationFormat::parallax:
      return "parallax";
    case CalibrationFormat::kalibr:
      return "kalibr";
    case CalibrationFormat::opencv:
      return "opencv";
    case CalibrationFormat::ros:
      return "ros";
    case CalibrationFormat::orb_slam:
      return "orbslam";
    case CalibrationFormat::ptam:
      return "ptam";
  }
  return "unknown";
}

CalibrationFormat calibration_format(const std::string& name) {
  for (const CalibrationFormat format :
       {CalibrationFormat::parallax, CalibrationFormat::kalibr, CalibrationFormat::opencv, CalibrationFormat::ros,
        CalibrationFormat::orb_slam, CalibrationFormat::ptam})
    if (name == to_string(format)) return format;
  throw InputError("format: found '" + name + "', expected parallax, kalibr, opencv, ros, orbslam or ptam");
}

std::string format_problem(const CameraModel& camera, CalibrationFormat format) {
  const CameraModelKind kind = camera.kind();
  const bool long_radtan = kind == CameraModelKind::radtan && camera.n_distortion() > 4;
  switch (format) {
    case CalibrationFormat::parallax:
      return "";
    case CalibrationFormat::kalibr:
      return long_radtan ? "pinhole, radtan4, kannala_brandt or fov" : "";
    case CalibrationFormat::opencv:
    case CalibrationFormat::ros:
      return kind == CameraModelKind::fov ? "pinhole, radtan4, radtan5, radtan8 or kannala_brandt" : "";
    case CalibrationFormat::orb_slam:
      return kind == CameraModelKind::fov || camera.n_distortion() > 5 ? "pinhole, radtan4, radtan5 or kannala_brandt"
                                                                       : "";
    case CalibrationFormat::ptam:
      return kind == CameraModelKind::fov ? "" : "fov";
  }
  return "";
}

std::string format_calibration(const CameraModel& camera) {
  return format_calibration(camera, CalibrationFormat::parallax);
}

std::string format_calibration(const CameraModel& camera, CalibrationFormat format, const std::string& name) {
  const std::string holds = format_problem(camera, format);
  if (!holds.empty())
    throw InputError(std::string("format ") + to_string(format) + ": found the model " + to_string(camera.kind()) +
                     (camera.kind() == CameraModelKind::radtan ? std::to_string(camera.n_distortion()) : "") +
                     ", expected " + holds);
  std::ostringstream out;
  switch (format) {
    case CalibrationFormat::parallax:
      out << "%YAML:1.0\n# focal lengths and centre in pixels; pixel centres at integer coordinates\n";
      write_parallax_keys(camera, "Camera.", out);
      break;
    case CalibrationFormat::kalibr:
      out << "cam0:\n";
      write_kalibr_keys(camera, "  ", "distortion_coeffs", out);
      break;
    case CalibrationFormat::opencv:
      write_opencv(camera, out);
      break;
    case CalibrationFormat::ros:
      write_ros(camera, name, out);
      break;
    case CalibrationFormat::orb_slam:
      write_orb_slam(camera, out);
      break;
    case CalibrationFormat::ptam:
      write_ptam(camera, out);
      break;
  }
  return out.str();
}

void write_calibration(const CameraModel& camera, const std::string& path) {
  write_calibration(camera, CalibrationFormat::parallax, path);
}

void write_calibration(const CameraModel& camera, CalibrationFormat format, const std::string& path) {
  const std::string text = format_calibration(camera, format);
  write_file_atomically(path, [&text](std::ostream& out) { out << text; });
}

std::string format_stereo_calibration(const StereoCalibration& rig) {
  std::ostringstream out;
  out << "%YAML:1.0\n# a stereo rig: Camera is the left one; focal lengths and centres in pixels; pixel centres at "
         "integer coordinates\n";
  write_parallax_keys(rig.left, "Camera.", out);
  write_parallax_keys(rig.right, "Right.", out);
  std::vector<double> rows;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rows.push_back(rig.right_from_left.R(row, column));
    rows.push_back(rig.right_from_left.t(row));
  }
  out << "# takes a point from the left camera's frame to the right one's: three rows of four, metres\n";
  out << "Right.from_left: " << exact_list(rows) << "\n";
  return out.str();
}

void write_stereo_calibration(const StereoCalibration& rig, const std::string& path) {
  const std::string text = format_stereo_calibration(rig);
  write_file_atomically(path, [&text](std::ostream& out) { out << text; });
}

std::string format_euroc_sensor(const CameraModel& camera, const RigidTransform& body_from_camera, double rate_hz) {
  const bool radtan = camera.kind() == CameraModelKind::radtan && camera.n_distortion() == 4;
  if (!radtan && camera.kind() != CameraModelKind::kannala_brandt && camera.kind() != CameraModelKind::pinhole)
    throw InputError(std::string("sensor.yaml: found the model ") + to_string(camera.kind()) +
                     ", expected pinhole, radtan4 or kannala_brandt");
  std::ostringstream out;
  std::vector<double> rows;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 3; ++column) rows.push_back(row < 3 ? body_from_camera.R(row, column) : 0.0);
    rows.push_back(row < 3 ? body_from_camera.t(row) : 1.0);
  }
  out << "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: " << exact_list(rows)
      << "\nrate_hz: " << exact(rate_hz) << "\n";
  if (camera.kind() == CameraModelKind::pinhole) {
    // This form always states four coefficients.
    const CameraModel straight(CameraModelKind::radtan, camera.width(), camera.height(), camera.focal_px(),
                               camera.centre_px(), {}, 4);
    write_kalibr_keys(straight, "", "distortion_coefficients", out);
  } else {
    write_kalibr_keys(camera, "", "distortion_coefficients", out);
  }
  std::string text = out.str();
  const std::string ours = "distortion_model: radtan\n";
  if (const auto at = text.find(ours); at != std::string::npos)
    text.replace(at, ours.size(), "distortion_model: radial-tangential\n");
  return text;
}

}  // namespace parallax
