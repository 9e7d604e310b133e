#include "camera/v4l2_camera.h"

#include <linux/videodev2.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>

#include "camera/pixel_format.h"
#include "camera/v4l2_connection.h"
#include "core/log.h"

namespace parallax {
namespace {

constexpr std::chrono::milliseconds kLookAgain{500};      // for an unplugged camera
constexpr Timestamp kSilence = std::chrono::seconds(10);  // a camera that sends nothing for so long is opened anew
constexpr std::size_t kMaxWarnings = 100;                 // kept for someone who never asks
constexpr std::uint32_t kMaxLost = 1000;                  // a larger gap in the numbers is a driver that counts oddly
constexpr char kDisconnected[] = "camera disconnected: plug it in again";

class V4l2Camera final : public LiveCamera {
 public:
  V4l2Camera(std::shared_ptr<V4l2System> system, const std::string& path, const LiveCameraOptions& options)
      : system_(std::move(system)), path_(path), options_(options) {
    auto connection = path_.empty() ? connect_first_v4l2(system_, options_)
                                    : std::make_shared<V4l2Connection>(system_, path_, options_);
    width_ = options_.width = connection->mode.width;
    height_ = options_.height = connection->mode.height;
    begin(std::move(connection));
  }

  std::optional<Frame> next() override;
  CameraStatus status() const override {
    const MutexLock lock(mutex_);
    return status_;
  }
  void stop() override;
  std::vector<CameraControl> controls() override {
    const auto connection = current();
    return connection ? connection->controls.list() : std::vector<CameraControl>();
  }
  void set_control(const std::string& name, std::int64_t value) override;

  int width() const override { return width_; }
  int height() const override { return height_; }
  std::string identity() const override {
    const MutexLock lock(mutex_);
    return identity_;
  }
  std::string description() const override {
    const MutexLock lock(mutex_);
    return description_;
  }
  double frames_per_second() const override {
    const MutexLock lock(mutex_);
    return status_.requested_fps > 0 ? status_.requested_fps : options_.fps;
  }
  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }

 private:
  std::shared_ptr<V4l2Connection> current() const {
    const MutexLock lock(mutex_);
    return connection_;
  }
  void begin(std::shared_ptr<V4l2Connection> connection);
  void disconnect(const std::string& text);
  void look_for_camera();
  // False: the camera has gone.
  bool wait_for_frame(V4l2Connection& connection, bool* ready);
  std::optional<V4l2Stream::Buffer> take_newest(V4l2Connection& connection, int* taken, int* error);
  std::optional<Frame> decode(V4l2Connection& connection, const V4l2Stream::Buffer& buffer);
  void count(V4l2Connection& connection, const V4l2Stream::Buffer& buffer);
  bool is_stale(const V4l2Connection& connection, const V4l2Stream::Buffer& buffer) const;
  void delivered(V4l2Connection& connection, const Frame& frame);
  void warn(int frame, const std::string& text) {
    log::debug(text);
    if (warnings_.size() < kMaxWarnings) warnings_.push_back({frame, text});
  }

  const std::shared_ptr<V4l2System> system_;
  const std::string path_;
  LiveCameraOptions options_;  // width and height: what the first camera gave
  int width_ = 0, height_ = 0;
  WakeEvent wake_;
  std::atomic<bool> stopped_{false};

  mutable Mutex mutex_;
  std::shared_ptr<V4l2Connection> connection_ PARALLAX_GUARDED_BY(mutex_);
  CameraStatus status_ PARALLAX_GUARDED_BY(mutex_);
  std::string identity_ PARALLAX_GUARDED_BY(mutex_), description_ PARALLAX_GUARDED_BY(mutex_);
  std::vector<std::pair<std::string, std::int64_t>> wanted_controls_ PARALLAX_GUARDED_BY(mutex_);

  // Of the thread that reads.
  std::vector<SourceWarning> warnings_;
  int next_index_ = 0;
  Timestamp last_time_{0}, heard_{0}, rated_{0};
};

void V4l2Camera::begin(std::shared_ptr<V4l2Connection> connection) {
  heard_ = rated_ = system_->now();
  const auto& device = *connection->device;
  const auto& mode = connection->mode;
  log::debug("camera ", device.source(), " (", device.identity(), "): ", fourcc_text(mode.code), " ", mode.width, "x",
             mode.height, " at ", mode.rate, " frames a second");
  const MutexLock lock(mutex_);
  identity_ = device.identity();
  description_ = device.source() + " (" + device.card() + ")";
  status_.state = CameraState::starting;
  status_.text = "camera starting";
  status_.requested_fps = mode.rate;
  status_.measured_fps = 0;
  status_.fps_reason.clear();
  for (const auto& [name, value] : wanted_controls_) {
    try {
      connection->controls.set_by_name(name, value);
    } catch (const InputError& error) {
      log::debug(error.what());  // another camera need not have it
    }
  }
  connection_ = std::move(connection);
}

void V4l2Camera::disconnect(const std::string& text) {
  std::shared_ptr<V4l2Connection> gone;  // closed outside the lock
  const MutexLock lock(mutex_);
  gone.swap(connection_);
  status_.state = CameraState::disconnected;
  status_.text = text;
  status_.measured_fps = 0;
  status_.fps_reason.clear();
}

void V4l2Camera::look_for_camera() {
  std::array<pollfd, 1> wait{{{wake_.descriptor(), POLLIN, 0}}};
  system_->poll(wait, kLookAgain);
  if (stopped_) return;
  std::string problem;
  auto connection = reconnect_v4l2(system_, path_, identity(), options_, &problem);
  if (connection) return begin(std::move(connection));
  const MutexLock lock(mutex_);
  status_.text = problem.empty() ? kDisconnected : std::string(kDisconnected) + " (" + problem + ")";
}

std::optional<Frame> V4l2Camera::next() {
  bool waited_for_fresh = false;
  while (!stopped_) {
    const auto connection = current();
    if (!connection) {
      look_for_camera();
      continue;
    }
    bool ready = false;
    if (!wait_for_frame(*connection, &ready)) continue;
    if (!ready) continue;
    int taken = 0, error = 0;
    const auto buffer = take_newest(*connection, &taken, &error);
    if (error == -ENODEV || error == -ENXIO || error == -EBADF) {
      if (buffer) connection->stream.give_back(*buffer);
      disconnect(kDisconnected);
      continue;
    }
    if (!buffer) continue;
    // All buffers were full: what came after them was lost, and the newest of them may be old.
    if (taken == connection->stream.buffer_count() && !waited_for_fresh && is_stale(*connection, *buffer)) {
      waited_for_fresh = true;
      connection->stream.give_back(*buffer);
      const MutexLock lock(mutex_);
      ++status_.skipped;
      continue;
    }
    auto frame = decode(*connection, *buffer);
    connection->stream.give_back(*buffer);
    if (!frame) continue;
    delivered(*connection, *frame);
    return frame;
  }
  disconnect("camera stopped");
  return std::nullopt;
}

bool V4l2Camera::wait_for_frame(V4l2Connection& connection, bool* ready) {
  std::array<pollfd, 2> wait{{{connection.device->descriptor(), POLLIN, 0}, {wake_.descriptor(), POLLIN, 0}}};
  const int result = system_->poll(wait, kLookAgain);
  *ready = result > 0 && wait[0].revents != 0 && !stopped_;
  if (stopped_) return true;
  if (wait[0].revents & (POLLERR | POLLHUP | POLLNVAL)) {
    // Also what a driver says whose stream has stopped: either way this connection is over once nothing can be taken.
    V4l2Stream::Buffer buffer;
    if (connection.stream.take(&buffer) == 0) {
      connection.stream.give_back(buffer);
    } else {
      disconnect(kDisconnected);
      return false;
    }
  }
  if (!*ready && system_->now() - heard_ > kSilence) {
    disconnect("the camera sends no pictures: starting it again; if that does not help, plug it in again");
    return false;
  }
  return true;
}

std::optional<V4l2Stream::Buffer> V4l2Camera::take_newest(V4l2Connection& connection, int* taken, int* error) {
  std::optional<V4l2Stream::Buffer> newest;
  // At most every buffer once: a fast camera must not keep this from ending.
  while (*taken < connection.stream.buffer_count()) {
    V4l2Stream::Buffer buffer;
    *error = connection.stream.take(&buffer);
    if (*error < 0) break;
    ++*taken;
    count(connection, buffer);
    if (buffer.damaged) {
      warn(next_index_++, description() + ": skipped: the driver reports a damaged frame");
      connection.stream.give_back(buffer);
      continue;
    }
    if (newest) {
      connection.stream.give_back(*newest);
      ++next_index_;
      const MutexLock lock(mutex_);
      ++status_.skipped;
    }
    newest = buffer;
  }
  return newest;
}

void V4l2Camera::count(V4l2Connection& connection, const V4l2Stream::Buffer& buffer) {
  heard_ = system_->now();
  std::uint32_t lost = 0;
  if (connection.last_sequence && buffer.sequence > *connection.last_sequence) {
    lost = buffer.sequence - *connection.last_sequence - 1;
    if (lost > kMaxLost) lost = 0;
  }
  connection.last_sequence = buffer.sequence;
  connection.meter.add(buffer.time, lost);
  const MutexLock lock(mutex_);
  status_.skipped += lost;
}

bool V4l2Camera::is_stale(const V4l2Connection& connection, const V4l2Stream::Buffer& buffer) const {
  const double rate = connection.mode.rate;
  constexpr double intervals = 1.5;
  return rate > 0 && to_seconds(system_->now() - buffer.time) > intervals / rate;
}

std::optional<Frame> V4l2Camera::decode(V4l2Connection& connection, const V4l2Stream::Buffer& buffer) {
  const auto& mode = connection.mode;
  RawPicture picture;
  picture.format = mode.format;
  picture.width = mode.width;
  picture.height = mode.height;
  picture.stride = mode.stride;
  picture.bytes = buffer.bytes;
  Frame frame;
  frame.index = next_index_++;
  const std::string problem = decode_picture(picture, &frame.grey, options_.colour ? &frame.colour : nullptr);
  if (!problem.empty()) {
    warn(frame.index, description() + ": skipped: " + problem);
    return std::nullopt;
  }
  frame.time = buffer.time;
  if (frame.time <= last_time_) frame.time = std::max(system_->now(), last_time_ + Timestamp(1));
  last_time_ = frame.time;
  return frame;
}

void V4l2Camera::delivered(V4l2Connection& connection, const Frame& frame) {
  if (connection.profile && !stopped_) {
    if (const auto text = connection.profile->on_frame(frame.time, frame.grey)) warn(-1, description() + ": " + *text);
  }
  constexpr Timestamp look_at_controls_every = std::chrono::seconds(1);
  std::optional<std::string> reason;
  const double rate = connection.meter.rate();
  if (connection.meter.is_settled() && frame.time - rated_ >= look_at_controls_every) {
    rated_ = frame.time;
    reason = slow_reason(connection.controls, rate, connection.mode.rate);
  }
  const MutexLock lock(mutex_);
  status_.state = CameraState::streaming;
  status_.measured_fps = rate;
  if (reason) status_.fps_reason = *reason;
  status_.text = status_.fps_reason.empty()
                     ? ""
                     : std::to_string(std::lround(rate)) + " frames a second instead of " +
                           std::to_string(std::lround(connection.mode.rate)) + ": " + status_.fps_reason;
}

void V4l2Camera::stop() {
  stopped_ = true;
  wake_.signal();
  if (const auto connection = current()) connection->controls.restore();
}

void V4l2Camera::set_control(const std::string& name, std::int64_t value) {
  const auto connection = current();
  if (!connection) throw InputError(description() + ": control " + name + " cannot be set: " + kDisconnected);
  connection->controls.set_by_name(name, value);
  const MutexLock lock(mutex_);
  std::erase_if(wanted_controls_, [&](const auto& wanted) { return wanted.first == name; });
  wanted_controls_.emplace_back(name, value);
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
  return std::make_unique<V4l2Camera>(std::move(system), path, options);
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
