// A camera of libcamera while it is plugged in: acquired, configured, its buffers, its stream of requests. Unplugging
// ends a connection; camera/libcamera_camera makes the next one. Included where the library is there.
#pragma once

#include <libcamera/libcamera.h>

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/libcamera_formats.h"
#include "camera/live_camera.h"
#include "camera/live_frame_rate.h"
#include "core/mutex.h"
#include "core/time.h"

namespace parallax {

// What wakes the thread that waits for frames. Shared by the camera and its connections; any thread.
struct LibcameraSignal {
  Mutex mutex;
  std::condition_variable_any condition;
  bool stopped PARALLAX_GUARDED_BY(mutex) = false;
};

// Streams from construction to destruction. libcamera calls back on its own thread: the newest picture is kept, the one
// before it goes back to the driver at once.
class LibcameraConnection {
 public:
  // Throws InputError: busy, no usable format.
  LibcameraConnection(std::shared_ptr<libcamera::CameraManager> manager, std::shared_ptr<libcamera::Camera> camera,
                      const LiveCameraOptions& options, std::shared_ptr<LibcameraSignal> signal);
  ~LibcameraConnection();
  LibcameraConnection(const LibcameraConnection&) = delete;
  LibcameraConnection& operator=(const LibcameraConnection&) = delete;

  // The newest picture since the last call, for at most `wait`; null when none came, it was unplugged, or the signal
  // says stop. It belongs to the caller until give_back.
  libcamera::Request* take(std::chrono::milliseconds wait);
  void give_back(libcamera::Request* request);
  // The bytes of a taken picture, and its time; `damaged` when the driver says so.
  RawPicture picture(libcamera::Request* request, Timestamp* time, bool* damaged) const;

  bool is_gone() const;
  std::uint64_t take_skipped();  // since the last call
  double measured_fps() const;
  double requested_fps() const { return requested_fps_; }  // 0: the camera cannot be told
  int width() const { return width_; }
  int height() const { return height_; }
  std::string identity() const { return "libcamera, " + libcamera_product(*camera_) + ", " + camera_->id(); }
  std::string source() const { return "libcamera:" + camera_->id(); }

  // Any thread. Changes travel with the next request. What was changed goes back to its default by restore(), which
  // waits shortly for a request to take it along.
  std::vector<CameraControl> controls() const;
  void set_control(const std::string& name, std::int64_t value);
  void restore();

  // See TrackingProfile: holds exposure, gain, white balance and focus where the camera's own reports say they are.
  void hold_settled_values(libcamera::Request* request);

 private:
  void acquire();
  void configure(const LiveCameraOptions& options);
  void allocate();
  void start(const LiveCameraOptions& options);
  void release();
  void queue(libcamera::Request* request);
  void on_completed(libcamera::Request* request);
  void on_disconnected();
  bool has(unsigned int id) const { return camera_->controls().count(id) > 0; }
  template <class Control, class Value>
  void set_pending(const Control& control, const Value& value);
  std::span<const std::uint8_t> bytes_of(const libcamera::FrameBuffer::Plane& plane, std::size_t used) const;
  void sync(libcamera::Request* request, bool begin) const;

  const std::shared_ptr<libcamera::CameraManager> manager_;
  const std::shared_ptr<libcamera::Camera> camera_;
  const std::shared_ptr<LibcameraSignal> signal_;
  bool acquired_ = false;
  int width_ = 0, height_ = 0;
  double requested_fps_ = 0;
  PixelFormat format_ = PixelFormat::yuyv;
  std::size_t stride_ = 0;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  libcamera::Stream* stream_ = nullptr;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::map<int, std::span<const std::uint8_t>> memory_;  // by descriptor
  std::vector<std::unique_ptr<libcamera::Request>> requests_;
  std::vector<LibcameraControl> known_controls_;  // as they were at first

  // Guarded by signal_->mutex.
  libcamera::Request* newest_ = nullptr;
  bool gone_ = false, closing_ = false;
  std::uint64_t skipped_ = 0;
  FrameRateMeter meter_;
  std::optional<unsigned int> last_sequence_;
  std::map<unsigned int, libcamera::ControlValue> pending_;  // to go with the next request
  std::map<unsigned int, std::int64_t> set_;                 // by set_control
  std::vector<unsigned int> changed_;
};

}  // namespace parallax
