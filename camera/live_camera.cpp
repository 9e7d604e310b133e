#include "camera/live_camera.h"

#include <cmath>

#include "camera/image_file.h"
#include "camera/libcamera_camera.h"
#include "camera/v4l2_camera.h"
#include "core/error.h"

namespace parallax {
namespace {

bool strip_prefix(std::string* text, const std::string& prefix) {
  if (text->rfind(prefix, 0) != 0) return false;
  text->erase(0, prefix.size());
  return true;
}

void validate(const LiveCameraOptions& options) {
  if (const auto problem = image_size_problem({options.width, options.height}); !problem.empty()) {
    throw InputError("camera size: " + problem);
  }
  constexpr double fastest = 1000;
  if (!std::isfinite(options.fps) || options.fps <= 0 || options.fps > fastest) {
    throw InputError("camera rate: found " + std::to_string(options.fps) + ", expected above 0 and at most 1000");
  }
}

}  // namespace

std::unique_ptr<LiveCamera> open_live_camera(const std::string& source, const LiveCameraOptions& options) {
  validate(options);
  std::string name = source;
  if (strip_prefix(&name, "v4l2:")) return open_v4l2_camera(kernel_v4l2_system(), name, options);
  if (strip_prefix(&name, "libcamera:")) return open_libcamera_camera(name, options);
  throw InputError(source + ": is no live camera, expected v4l2:/dev/videoN, v4l2:, libcamera:NAME or libcamera:");
}

std::vector<CameraInfo> list_cameras() {
  auto cameras = list_v4l2_cameras(kernel_v4l2_system());
  for (auto& camera : list_libcamera_cameras()) cameras.push_back(std::move(camera));
  return cameras;
}

}  // namespace parallax
