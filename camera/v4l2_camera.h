// A live camera behind V4L2. See camera/live_camera.h for what it promises.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "camera/live_camera.h"
#include "camera/v4l2_system.h"

namespace parallax {

// `path`: "/dev/video0", or empty for the first camera that can be used. next() works on the caller's thread: there is
// no thread behind it. Throws InputError.
std::unique_ptr<LiveCamera> open_v4l2_camera(std::shared_ptr<V4l2System> system, const std::string& path,
                                             const LiveCameraOptions& options);

// Everything that captures video, with its formats and controls, or the problem it has.
std::vector<CameraInfo> list_v4l2_cameras(std::shared_ptr<V4l2System> system);

}  // namespace parallax
