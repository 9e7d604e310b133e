// What libcamera offers in this program's words: the one camera manager of the process, pixel formats, modes, controls.
// Only for the files of the libcamera camera; included where the library is there.
#pragma once

#include <libcamera/libcamera.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/image_file.h"
#include "camera/live_camera.h"
#include "camera/pixel_format.h"

namespace parallax {

// libcamera allows one manager a process: started when first wanted, stopped when the last one lets go of it, which
// must be after everything that was had from it. Throws InputError when it does not start. Any thread.
std::shared_ptr<libcamera::CameraManager> libcamera_manager();

std::optional<PixelFormat> pixel_format_of(const libcamera::PixelFormat& format);
libcamera::PixelFormat libcamera_format_of(PixelFormat format);

// Formats under V4L2's names, where this program knows them. Of ranges of sizes, those that libcamera lists and the
// `wanted` one. libcamera lists no rates.
std::vector<CameraFormat> libcamera_formats(const libcamera::StreamConfiguration& stream, ImageSize wanted = {});

// Switches, integers, and numbers with a point (in thousandths, with "_milli" at the end of the name). The names are
// libcamera's in lower case with underscores: ae_enable, exposure_time, analogue_gain_milli.
struct LibcameraControl {
  CameraControl control;
  unsigned int id = 0;
  libcamera::ControlType type = libcamera::ControlTypeNone;
  libcamera::ControlValue to_value(std::int64_t value) const;
};
std::vector<LibcameraControl> libcamera_controls(const libcamera::Camera& camera);

// The product's name, or the identifier.
std::string libcamera_product(const libcamera::Camera& camera);
// See LiveCamera::identity.
std::string libcamera_identity(const libcamera::Camera& camera);

}  // namespace parallax
