// What a way to reach cameras (V4L2, libcamera) provides so that camera/reconnecting_camera can make a LiveCamera of
// it: where cameras are, and one of them while it is plugged in.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/live_camera.h"
#include "camera/pixel_format.h"
#include "core/frame.h"

namespace parallax {

// What came of waiting for a picture.
struct CameraArrival {
  enum class Kind {
    nothing,  // no picture: the wait is over, or those that came are counted below
    picture,
    gone  // unplugged, or its stream has ended: this connection is over
  };
  Kind kind = Kind::nothing;
  RawPicture picture;  // valid until give_back()
  Timestamp time{0};   // of the picture, CLOCK_MONOTONIC, by the driver
  int skipped = 0;     // frames since the arrival before that nobody took, and that were lost on their way
  int damaged = 0;     // frames since the arrival before that the driver says are damaged
  bool heard() const { return kind == Kind::picture || skipped > 0 || damaged > 0; }
};

// A camera that is plugged in and streams, from construction to destruction. Its end puts back the controls that were
// changed.
class CameraConnection {
 public:
  virtual ~CameraConnection() = default;

  struct Facts {
    std::string source;       // what to write on the command line
    std::string description;  // the same with the name of the product
    std::string identity;     // see LiveCamera::identity
    std::string mode;         // "YUYV 640x480", for the log
    int width = 0, height = 0;
    double fps = 0;  // what the mode promises; 0: not known
  };
  virtual const Facts& facts() const = 0;

  // Of the thread that reads. The newest picture there is; waits for one, for at most `wait` or until the back end is
  // woken. A picture goes back to the driver by give_back(), before the next call.
  virtual CameraArrival next(std::chrono::milliseconds wait) = 0;
  virtual void give_back() = 0;
  // To be told of every picture that was good, before it is given back: where the camera is held still for tracking
  // (see LiveCameraOptions::tracking_profile). Returns a line for the user when there is something to say.
  virtual std::optional<std::string> settle(const Frame& frame) = 0;
  // Why frames come at this rate and not at the one promised, as far as it can tell; else empty.
  virtual std::string slow_reason(double measured_fps) const = 0;

  // Any thread. See LiveCamera; set_control throws InputError.
  virtual std::vector<CameraControl> controls() const = 0;
  virtual void set_control(const std::string& name, std::int64_t value) = 0;
  // Puts controls back, and changes none from then on.
  virtual void restore() = 0;
};

// Where cameras come from, and the time by which they are waited for. Of the thread that reads, except for wake().
class CameraBackend {
 public:
  virtual ~CameraBackend() = default;

  // Names for open(), in the order in which they are to be tried. `identity`: that of the camera that was lost, which
  // comes first; empty when the first one is opened. Nothing is connected while this is called.
  virtual std::vector<std::string> candidates(const std::string& identity) = 0;
  // Throws InputError with what to do: no such device, busy, permission denied, no usable format.
  virtual std::unique_ptr<CameraConnection> open(const std::string& name, const LiveCameraOptions& options) = 0;
  // The line for the user when there are no candidates.
  virtual std::string none_found() const = 0;

  // Waits, until wake() at the latest.
  virtual void wait(std::chrono::milliseconds time) = 0;
  // Ends every wait, of connections too, now and from now on. Any thread.
  virtual void wake() = 0;
  // CLOCK_MONOTONIC. Any thread.
  virtual Timestamp now() const = 0;
};

}  // namespace parallax
