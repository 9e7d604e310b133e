// Cameras that deliver frames as time passes: V4L2, libcamera, and the synthetic hand-held camera in render/.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "camera/frame_source.h"

namespace parallax {

// disconnected: there are no pictures and the user has to do something; the status says what.
enum class CameraState { starting, streaming, disconnected };

struct CameraStatus {
  CameraState state = CameraState::starting;
  std::string text;           // for the user: "camera disconnected: plug it in again", why frames come slowly...
  double measured_fps = 0;    // over about the last second
  double requested_fps = 0;   // what the format promises
  std::string fps_reason;     // why the rate fell, when known ("automatic exposure: more light helps"); else empty
  std::uint64_t skipped = 0;  // frames the driver delivered that nobody took (newest-frame policy)
  std::uint64_t damaged = 0;  // frames that came damaged and were dropped
};

struct CameraControl {
  std::string name;  // of the driver, lower case with underscores, as v4l2-ctl writes it: exposure_time_absolute
  std::int64_t minimum = 0, maximum = 0, step = 1, default_value = 0, value = 0;
  bool read_only = false, inactive = false;
  std::vector<std::pair<std::int64_t, std::string>> menu;  // for menu controls
};

// next() waits for the newest frame. After unplugging it goes on waiting: when the camera (or another, where the name
// was not given) is plugged in, frames come again, with their numbers counting on. Nothing only after stop().
class LiveCamera : public FrameSource {
 public:
  // From any thread.
  virtual CameraStatus status() const = 0;
  // next() returns nothing, now and from now on. Controls that were changed are put back. From any thread.
  virtual void stop() = 0;

  // Driver controls; empty where there are none. set_control throws InputError for an unknown name or value out of
  // range. From any thread.
  virtual std::vector<CameraControl> controls() = 0;
  virtual void set_control(const std::string& name, std::int64_t value) = 0;

  // The size of the images; known as soon as it is open.
  virtual int width() const = 0;
  virtual int height() const = 0;
  // Names the device across restarts (for remembering calibrations): driver, card, bus.
  virtual std::string identity() const = 0;

  int frame_count() const final { return -1; }
};

struct LiveCameraOptions {
  bool colour = true;
  int width = 640, height = 480;  // wanted; the nearest that the camera offers is taken
  double fps = 30;
  std::string pixel_format;  // fourcc that is wanted (YUYV, MJPG...); empty: the best
  // Locks focus, exposure time and white balance once they have settled and turns sharpening off, where the driver can;
  // put back at the end.
  bool tracking_profile = true;
};

// "v4l2:/dev/video0", "v4l2:" (the first), "libcamera:NAME", "libcamera:" (the first). Throws InputError with one line
// that says what to do: no such device, busy, permission denied, no usable format.
std::unique_ptr<LiveCamera> open_live_camera(const std::string& source, const LiveCameraOptions& options = {});

struct CameraFormat {
  std::string pixel_format;  // fourcc: YUYV, MJPG...
  int width = 0, height = 0;
  std::vector<double> rates;  // frames a second
  bool usable = false;        // one we decode
};

struct CameraInfo {
  std::string source;  // what to write on the command line: v4l2:/dev/video0
  std::string name;    // of the product
  std::string bus;
  std::vector<CameraFormat> formats;
  std::vector<CameraControl> controls;
  std::string problem;  // why it cannot be used (busy, permission denied); else empty
};

// All cameras there are, V4L2 first; devices that capture no video are left out. Never throws for want of cameras.
std::vector<CameraInfo> list_cameras();

}  // namespace parallax
