// A camera of libcamera while it is plugged in: acquired, configured, its buffers, its stream of requests. Included
// where the library is there.
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

#include "camera/camera_connection.h"
#include "camera/libcamera_formats.h"
#include "core/mutex.h"
#include "core/time.h"

namespace parallax {

// What wakes the thread that waits for frames. Shared by the back end and its connections; any thread.
struct LibcameraSignal {
  Mutex mutex;
  std::condition_variable_any condition;
  bool stopped PARALLAX_GUARDED_BY(mutex) = false;
};

// Streams from construction to destruction. libcamera calls back on its own thread: the newest picture is kept, the one
// before it goes back to the driver at once.
class LibcameraConnection final : public CameraConnection {
 public:
  // Throws InputError: busy, no usable format.
  LibcameraConnection(std::shared_ptr<libcamera::CameraManager> manager, std::shared_ptr<libcamera::Camera> camera,
                      const LiveCameraOptions& options, std::shared_ptr<LibcameraSignal> signal);
  ~LibcameraConnection() override;
  LibcameraConnection(const LibcameraConnection&) = delete;
  LibcameraConnection& operator=(const LibcameraConnection&) = delete;

  const Facts& facts() const override { return facts_; }
  CameraArrival next(std::chrono::milliseconds wait) override;
  void give_back() override;
  // Holds exposure, gain, white balance and focus where the camera's own reports say they are.
  std::optional<std::string> settle(const Frame& frame) override;
  std::string slow_reason(double) const override { return ""; }

  // Changes travel with the next request. What was changed goes back to its default by restore(), which waits shortly
  // for a request to take it along.
  std::vector<CameraControl> controls() const override;
  void set_control(const std::string& name, std::int64_t value) override;
  void restore() override;

 private:
  void acquire();
  void configure(const LiveCameraOptions& options);
  void allocate();
  void start(const LiveCameraOptions& options);
  void release();
  void queue(libcamera::Request* request);
  void give_back(libcamera::Request* request);
  void on_completed(libcamera::Request* request);
  void on_disconnected();
  void fill(CameraArrival* arrival) const;
  void hold_settled_values(libcamera::Request* request);
  bool has(unsigned int id) const { return camera_->controls().count(id) > 0; }
  template <class Control, class Value>
  void set_pending(const Control& control, const Value& value);
  std::span<const std::uint8_t> bytes_of(const libcamera::FrameBuffer::Plane& plane, std::size_t used) const;
  void sync(libcamera::Request* request, bool begin) const;

  const std::shared_ptr<libcamera::CameraManager> manager_;
  const std::shared_ptr<libcamera::Camera> camera_;
  const std::shared_ptr<LibcameraSignal> signal_;
  bool acquired_ = false;
  Facts facts_;
  PixelFormat format_ = PixelFormat::yuyv;
  std::size_t stride_ = 0;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  libcamera::Stream* stream_ = nullptr;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::map<int, std::span<const std::uint8_t>> memory_;  // by descriptor
  std::vector<std::unique_ptr<libcamera::Request>> requests_;
  std::vector<LibcameraControl> known_controls_;  // as they were at first

  // Of the thread that reads.
  libcamera::Request* taken_ = nullptr;
  std::optional<Timestamp> settling_since_;
  bool to_settle_ = false;

  // Guarded by signal_->mutex.
  libcamera::Request* newest_ = nullptr;
  bool gone_ = false, closing_ = false;
  int skipped_ = 0;
  std::optional<unsigned int> last_sequence_;
  std::map<unsigned int, libcamera::ControlValue> pending_;  // to go with the next request
  std::map<unsigned int, std::int64_t> set_;                 // by set_control
  std::vector<unsigned int> changed_;
};

}  // namespace parallax
