// Live cameras behind libcamera (Raspberry Pi and laptop MIPI cameras, USB cameras too). See camera/live_camera.h for
// what they promise. Without the library at build time there are none, and opening one says so.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "camera/live_camera.h"

namespace parallax {

// `name`: libcamera's identifier or a part of it, or empty for the first camera. Throws InputError.
std::unique_ptr<LiveCamera> open_libcamera_camera(const std::string& name, const LiveCameraOptions& options);

std::vector<CameraInfo> list_libcamera_cameras();

}  // namespace parallax
