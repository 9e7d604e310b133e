// Opens whatever a SOURCE on the command line names, with its calibration.
#pragma once

#include <memory>
#include <string>

#include "camera/frame_source.h"

namespace parallax {

struct OpenedSource {
  std::unique_ptr<FrameSource> frames;
  CameraModel camera;
};

// `calibration_path` empty: the one the source carries. Throws InputError when there is none, or when its size is not
// that of the images.
OpenedSource open_source(const std::string& source, const std::string& calibration_path, const SourceOptions& options);

}  // namespace parallax
