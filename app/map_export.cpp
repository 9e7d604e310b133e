#include "app/map_export.h"

#include <filesystem>
#include <iomanip>
#include <sstream>

#include "app/png_bytes.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

// COLMAP's pixel coordinates of the centre of our pixel (0, 0).
constexpr double kColmapPixel = 0.5;

std::string image_name(KeyframeId id) {
  std::ostringstream out;
  out << "keyframe_" << std::setw(5) << std::setfill('0') << id.index << ".png";
  return out.str();
}

std::filesystem::path made_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw RunError(folder + ": cannot be made: " + error.message());
  return folder;
}

// Model name and parameters. Ours are COLMAP's under other names; radtan with eight of them is FULL_OPENCV.
std::string camera_line(const CameraModel& camera) {
  const auto& d = camera.distortion();
  std::ostringstream out;
  out << std::setprecision(17);
  const auto head = [&](const char* model) {
    out << "1 " << model << ' ' << camera.width() << ' ' << camera.height() << ' ' << camera.focal_px().x() << ' '
        << camera.focal_px().y() << ' ' << camera.centre_px().x() + kColmapPixel << ' '
        << camera.centre_px().y() + kColmapPixel;
  };
  int parameters = 0;
  switch (camera.kind()) {
    case CameraModelKind::pinhole:
      head("PINHOLE");
      break;
    case CameraModelKind::radtan:
      head(camera.n_distortion() > 4 ? "FULL_OPENCV" : "OPENCV");
      parameters = camera.n_distortion() > 4 ? 8 : 4;
      break;
    case CameraModelKind::kannala_brandt:
      head("OPENCV_FISHEYE");
      parameters = 4;
      break;
    case CameraModelKind::fov:
      head("FOV");
      parameters = 1;
      break;
  }
  for (int i = 0; i < parameters; ++i) out << ' ' << d[static_cast<std::size_t>(i)];
  return out.str();
}

}  // namespace

void write_keyframe_images(const Map& map, const std::string& folder) {
  const std::filesystem::path to = made_folder(folder);
  for (const Keyframe& kf : map.keyframes) {
    const std::string file = (to / image_name(kf.id)).string();
    write_file_atomically(file, png_bytes(kf.images->pyramid.level[0], file));
  }
}

void write_colmap_model(const MapDocument& document, const std::string& name, const std::string& folder) {
  const CameraModel camera = parse_calibration(document.calibration, name + ": calibration");
  const std::filesystem::path to = made_folder(folder);
  const Map& map = document.map;
  write_file_atomically((to / "cameras.txt").string(), [&](std::ostream& out) {
    out << "# CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n" << camera_line(camera) << '\n';
  });
  // Identifiers count from 1 there; a point's place in a keyframe's list is what tracks refer to.
  write_file_atomically((to / "images.txt").string(), [&](std::ostream& out) {
    out << "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID\n" << std::setprecision(17);
    for (const Keyframe& kf : map.keyframes) {
      const Eigen::Quaterniond q = kf.camera_from_world.quaternion();
      const Eigen::Vector3d& t = kf.camera_from_world.t;
      out << kf.id.index + 1 << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << t.x() << ' '
          << t.y() << ' ' << t.z() << " 1 " << image_name(kf.id) << '\n';
      for (const Measurement& m : kf.measurements)
        out << m.pixel.x() + kColmapPixel << ' ' << m.pixel.y() + kColmapPixel << ' ' << m.point.index + 1 << ' ';
      out << '\n';
    }
  });
  write_file_atomically((to / "points3D.txt").string(), [&](std::ostream& out) {
    out << "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_INDEX\n" << std::setprecision(17);
    for (const MapPoint& p : map.points) {
      const GreyImage& source =
          map.keyframes.at(p.source).images->pyramid.level[static_cast<std::size_t>(p.source_level)];
      const int grey =
          source(static_cast<int>(std::lround(p.source_pixel.y())), static_cast<int>(std::lround(p.source_pixel.x())));
      double error = 0;
      std::ostringstream track;
      for (const KeyframeId id : p.observers) {
        const Keyframe& kf = map.keyframes.at(id);
        const Measurement* m = kf.find(p.id);
        Eigen::Vector2d pixel;
        if (camera.project(kf.camera_from_world * p.position, &pixel)) error += (pixel - m->pixel).norm();
        track << ' ' << id.index + 1 << ' ' << m - kf.measurements.data();
      }
      out << p.id.index + 1 << ' ' << p.position.x() << ' ' << p.position.y() << ' ' << p.position.z() << ' ' << grey
          << ' ' << grey << ' ' << grey << ' ' << error / std::max<double>(1.0, static_cast<double>(p.observers.size()))
          << track.str() << '\n';
    }
  });
}

}  // namespace parallax
