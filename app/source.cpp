#include "app/source.h"

#include "camera/calibration_file.h"
#include "core/error.h"
#include "render/synthetic_source.h"

namespace parallax {

OpenedSource open_source(const std::string& source, const std::string& calibration_path, const SourceOptions& options) {
  OpenedSource out;
  const std::string synthetic = "synthetic:";
  if (source.rfind(synthetic, 0) == 0) {
    out.frames = open_synthetic_source(source, options);
  } else if (source.rfind("v4l2:", 0) == 0 || source.rfind("libcamera:", 0) == 0) {
    throw InputError(
        source + ": live cameras are not supported by this version; expected a video file, a folder or synthetic:NAME");
  } else {
    out.frames = open_frame_source(source, options);
  }
  if (!calibration_path.empty()) {
    out.camera = read_calibration(calibration_path);
  } else if (const auto carried = out.frames->calibration()) {
    out.camera = *carried;
  } else {
    throw InputError(source + ": carries no calibration; expected --calibration FILE");
  }
  return out;
}

}  // namespace parallax
