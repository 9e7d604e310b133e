// A V4L2 camera while it is plugged in: the open device, its mode, its controls and its stream.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/camera_connection.h"
#include "camera/v4l2_controls.h"
#include "camera/v4l2_device.h"
#include "camera/v4l2_formats.h"
#include "camera/v4l2_stream.h"
#include "camera/v4l2_tracking_profile.h"

namespace parallax {

// Streams from construction on. Controls are put back when it goes, after the stream has ended.
class V4l2Connection final : public CameraConnection {
 public:
  // Opens `path` and starts it. `wake`: ends waits once it is signalled. Throws InputError with what to do.
  V4l2Connection(std::shared_ptr<V4l2System> system, const std::string& path, const LiveCameraOptions& options,
                 std::shared_ptr<WakeEvent> wake);

  const Facts& facts() const override { return facts_; }
  CameraArrival next(std::chrono::milliseconds wait) override;
  void give_back() override;
  std::optional<std::string> settle(const Frame& frame) override;
  std::string slow_reason(double measured_fps) const override;
  std::vector<CameraControl> controls() const override { return controls_.list(); }
  void set_control(const std::string& name, std::int64_t value) override { controls_.set_by_name(name, value); }
  void restore() override { controls_.restore(); }

 private:
  struct Taken {
    int count = 0, error = 0;
  };
  Taken take_all(CameraArrival* arrival);
  int lost_before(std::uint32_t sequence);
  bool is_stale(const V4l2Stream::Buffer& buffer) const;

  const std::shared_ptr<V4l2System> system_;
  const std::shared_ptr<WakeEvent> wake_;
  const std::shared_ptr<const V4l2Device> device_;
  V4l2Controls controls_;  // any thread
  const V4l2Mode mode_;
  Facts facts_;
  // Of the thread that reads frames.
  V4l2Stream stream_;
  std::optional<TrackingProfile> profile_;
  std::optional<std::uint32_t> last_sequence_;
  std::optional<V4l2Stream::Buffer> newest_;  // of the arrival
  bool waited_for_fresh_ = false;
};

}  // namespace parallax
