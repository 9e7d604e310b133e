// What a V4L2 device offers, and which of it suits best.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "camera/image_file.h"
#include "camera/live_camera.h"
#include "camera/pixel_format.h"
#include "camera/v4l2_device.h"

namespace parallax {

// A way to run a camera.
struct V4l2Mode {
  std::uint32_t code = 0;  // fourcc
  PixelFormat format = PixelFormat::yuyv;
  int width = 0, height = 0;
  double rate = 0;         // frames a second; 0: the driver does not say
  std::size_t stride = 0;  // bytes from row to row, known once it is set
};

// All formats, sizes and rates, in the driver's order. Of sizes and rates that go by steps, the customary ones in the
// range are listed, and of sizes the `wanted` one, each down to the nearest step. Rates fall.
std::vector<CameraFormat> v4l2_formats(const V4l2Device& device, ImageSize wanted = {});

// The usable modes, the best first: the size nearest to the one wanted; then the rate wanted, or else the highest;
// then the format that costs least (options.colour: grey formats last). Pure.
std::vector<V4l2Mode> rank_modes(const std::vector<CameraFormat>& formats, const LiveCameraOptions& options);

// Sets the first of the modes that the driver takes, and returns what it made of it (drivers adjust sizes). Throws
// InputError: busy, or no usable format (names what there is).
V4l2Mode set_best_mode(const V4l2Device& device, const LiveCameraOptions& options);

// "YUYV 640x480, MJPG 640x480 1280x720", for messages.
std::string format_summary(const std::vector<CameraFormat>& formats);

}  // namespace parallax
