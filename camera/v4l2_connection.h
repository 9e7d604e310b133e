// A V4L2 camera while it is plugged in: the open device, its mode, its controls and its stream. Unplugging ends a
// connection; camera/v4l2_camera makes the next one.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "camera/live_frame_rate.h"
#include "camera/v4l2_controls.h"
#include "camera/v4l2_device.h"
#include "camera/v4l2_formats.h"
#include "camera/v4l2_stream.h"
#include "camera/v4l2_tracking_profile.h"

namespace parallax {

// Streams from construction on. Controls are put back when it goes, after the stream has ended.
struct V4l2Connection {
  // Opens `path` and starts it. Throws InputError with what to do.
  V4l2Connection(std::shared_ptr<V4l2System> system, const std::string& path, const LiveCameraOptions& options)
      : device(std::make_shared<V4l2Device>(std::move(system), path)),
        controls(device),
        mode(set_best_mode(*device, options)),
        stream(device) {
    if (options.tracking_profile) profile.emplace(&controls);
  }

  const std::shared_ptr<const V4l2Device> device;
  V4l2Controls controls;  // any thread
  const V4l2Mode mode;
  // Of the thread that reads frames.
  V4l2Stream stream;
  std::optional<TrackingProfile> profile;
  FrameRateMeter meter;
  std::optional<std::uint32_t> last_sequence;
};

// Opens a camera again after it was unplugged, or another one in its place. `identity` is preferred; then `path`, or
// any camera when that is empty. Pictures must have the size of before. Null when there is none yet: `problem` then
// says what is wrong with the one that is there, or is empty.
std::shared_ptr<V4l2Connection> reconnect_v4l2(const std::shared_ptr<V4l2System>& system, const std::string& path,
                                               const std::string& identity, const LiveCameraOptions& options,
                                               std::string* problem);

// The first camera that can be used. Throws InputError: that of the first one that cannot, or that there is none.
std::shared_ptr<V4l2Connection> connect_first_v4l2(const std::shared_ptr<V4l2System>& system,
                                                   const LiveCameraOptions& options);

}  // namespace parallax
