#include "camera/v4l2_camera.h"

#include <linux/videodev2.h>

#include <array>
#include <cerrno>

#include "camera/reconnecting_camera.h"
#include "camera/v4l2_connection.h"
#include "core/error.h"

namespace parallax {
namespace {

class V4l2Backend final : public CameraBackend {
 public:
  V4l2Backend(std::shared_ptr<V4l2System> system, std::string path)
      : system_(std::move(system)), path_(std::move(path)), wake_(std::make_shared<WakeEvent>()) {}

  std::vector<std::string> candidates(const std::string& identity) override;
  std::unique_ptr<CameraConnection> open(const std::string& name, const LiveCameraOptions& options) override {
    return std::make_unique<V4l2Connection>(system_, name, options, wake_);
  }
  std::string none_found() const override { return "v4l2: no camera found: plug one in, or use synthetic:desk"; }

  void wait(std::chrono::milliseconds time) override {
    std::array<pollfd, 1> woken{{{wake_->descriptor(), POLLIN, 0}}};
    system_->poll(woken, time);
  }
  void wake() override { wake_->signal(); }
  Timestamp now() const override { return system_->now(); }

 private:
  const std::shared_ptr<V4l2System> system_;
  const std::string path_;  // empty: any
  const std::shared_ptr<WakeEvent> wake_;
};

// Device nodes. A camera of the identity looked for comes first, whatever its node.
std::vector<std::string> V4l2Backend::candidates(const std::string& identity) {
  if (identity.empty() && !path_.empty()) return {path_};
  std::vector<std::string> same, others;
  for (const auto& node : system_->device_paths()) {
    bool is_same = false;
    try {
      is_same = V4l2Device(system_, node).identity() == identity;
    } catch (const NotACaptureDevice&) {
      continue;
    } catch (const InputError&) {
      // Tried all the same: opening it says what is wrong.
    }
    if (is_same) {
      same.push_back(node);
    } else if (path_.empty() || node == path_) {
      others.push_back(node);
    }
  }
  same.insert(same.end(), others.begin(), others.end());
  return same;
}

// Whether someone else streams from it: asking for a buffer is refused then.
std::string busy_problem(const V4l2Device& device) {
  v4l2_requestbuffers request{};
  request.count = 1;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  const int error = device.ioctl(VIDIOC_REQBUFS, &request);
  if (error == -EBUSY) return v4l2_problem(device.path(), error, "asking for buffers");
  request.count = 0;
  device.ioctl(VIDIOC_REQBUFS, &request);
  return "";
}

}  // namespace

std::unique_ptr<LiveCamera> open_v4l2_camera(std::shared_ptr<V4l2System> system, const std::string& path,
                                             const LiveCameraOptions& options) {
  return std::make_unique<ReconnectingCamera>(std::make_unique<V4l2Backend>(std::move(system), path), options);
}

std::vector<CameraInfo> list_v4l2_cameras(std::shared_ptr<V4l2System> system) {
  std::vector<CameraInfo> cameras;
  for (const auto& path : system->device_paths()) {
    CameraInfo info;
    info.source = "v4l2:" + path;
    info.name = path;
    try {
      const auto device = std::make_shared<V4l2Device>(system, path);
      info.name = device->card();
      info.bus = device->bus();
      info.formats = v4l2_formats(*device);
      info.controls = V4l2Controls(device).list();
      info.problem = busy_problem(*device);
      if (info.problem.empty() && rank_modes(info.formats, {}).empty()) {
        info.problem = info.source + ": no usable format: offers " + format_summary(info.formats) +
                       ", expected one of " + known_pixel_formats();
      }
    } catch (const NotACaptureDevice&) {
      continue;
    } catch (const InputError& error) {
      info.problem = error.what();
    }
    cameras.push_back(std::move(info));
  }
  return cameras;
}

}  // namespace parallax
