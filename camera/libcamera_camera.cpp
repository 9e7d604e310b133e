#include "camera/libcamera_camera.h"

#ifndef PARALLAX_HAVE_LIBCAMERA

#include "core/error.h"

namespace parallax {

std::unique_ptr<LiveCamera> open_libcamera_camera(const std::string& name, const LiveCameraOptions&) {
  throw InputError("libcamera:" + name +
                   ": this program was built without libcamera; install libcamera-dev and build again");
}

std::vector<CameraInfo> list_libcamera_cameras() { return {}; }

}  // namespace parallax

#else

#include <atomic>

#include "camera/image_file.h"
#include "camera/libcamera_connection.h"
#include "core/error.h"
#include "core/log.h"

namespace parallax {
namespace {

constexpr std::chrono::milliseconds kLookAgain{500};
constexpr int kLooksBeforeAnew = 4;
constexpr Timestamp kSilence = std::chrono::seconds(10);
constexpr Timestamp kSettle = std::chrono::seconds(1);
constexpr std::size_t kMaxWarnings = 100;
constexpr char kDisconnected[] = "camera disconnected: plug it in again";

Timestamp now() { return SteadyClock::now().time_since_epoch(); }

class LibcameraCamera final : public LiveCamera {
 public:
  LibcameraCamera(const std::string& name, const LiveCameraOptions& options)
      : manager_(libcamera_manager()), name_(name), options_(options), signal_(std::make_shared<LibcameraSignal>()) {
    auto camera = find("");
    if (!camera) {
      throw InputError(name_.empty()
                           ? "libcamera: no camera found: plug one in, or use synthetic:desk"
                           : "libcamera:" + name_ +
                                 ": no such camera: is it plugged in? `parallax cameras` lists what is there");
    }
    auto connection = std::make_shared<LibcameraConnection>(manager_, std::move(camera), options_, signal_);
    width_ = options_.width = connection->width();
    height_ = options_.height = connection->height();
    begin(std::move(connection));
  }
  ~LibcameraCamera() override {
    const MutexLock lock(mutex_);
    connection_.reset();
  }

  std::optional<Frame> next() override;
  CameraStatus status() const override {
    const MutexLock lock(mutex_);
    return status_;
  }
  void stop() override;
  std::vector<CameraControl> controls() override {
    const auto connection = current();
    return connection ? connection->controls() : std::vector<CameraControl>();
  }
  void set_control(const std::string& name, std::int64_t value) override {
    const auto connection = current();
    if (!connection) throw InputError(description() + ": control " + name + " cannot be set: " + kDisconnected);
    connection->set_control(name, value);
  }
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
  double frames_per_second() const override { return options_.fps; }
  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }

 private:
  std::shared_ptr<LibcameraConnection> current() const {
    const MutexLock lock(mutex_);
    return connection_;
  }
  std::shared_ptr<libcamera::Camera> find(const std::string& preferred_source) const;
  void begin(std::shared_ptr<LibcameraConnection> connection);
  void disconnect(const std::string& text);
  void look_for_camera();
  void start_manager_anew();
  std::optional<Frame> decode(LibcameraConnection& connection, libcamera::Request* request);
  void warn(int frame, const std::string& text) {
    log::debug(text);
    if (warnings_.size() < kMaxWarnings) warnings_.push_back({frame, text});
  }

  std::shared_ptr<libcamera::CameraManager> manager_;  // of the thread that reads; null only after stop()
  int looks_in_vain_ = 0;                              // of the thread that reads: since the camera was there
  const std::string name_;
  LiveCameraOptions options_;  // width and height: what the first camera gave
  int width_ = 0, height_ = 0;
  const std::shared_ptr<LibcameraSignal> signal_;
  std::atomic<bool> stopped_{false};

  mutable Mutex mutex_;
  std::shared_ptr<LibcameraConnection> connection_ PARALLAX_GUARDED_BY(mutex_);
  CameraStatus status_ PARALLAX_GUARDED_BY(mutex_);
  std::string identity_ PARALLAX_GUARDED_BY(mutex_), description_ PARALLAX_GUARDED_BY(mutex_);

  // Of the thread that reads.
  std::vector<SourceWarning> warnings_;
  std::string source_;
  int next_index_ = 0;
  Timestamp last_time_{0}, heard_{0};
  std::optional<Timestamp> first_time_;  // of the connection
  bool held_ = false;
};

std::shared_ptr<libcamera::Camera> LibcameraCamera::find(const std::string& preferred_source) const {
  std::shared_ptr<libcamera::Camera> found;
  for (const auto& camera : manager_->cameras()) {
    if ("libcamera:" + camera->id() == preferred_source) return camera;
    const bool matches =
        camera->id().find(name_) != std::string::npos || libcamera_product(*camera).find(name_) != std::string::npos;
    if (matches && (!found || camera->id() == name_)) found = camera;
  }
  return found;
}

void LibcameraCamera::begin(std::shared_ptr<LibcameraConnection> connection) {
  heard_ = now();
  first_time_.reset();
  held_ = false;
  source_ = connection->source();
  log::debug("camera ", source_, ": ", connection->width(), "x", connection->height());
  const MutexLock lock(mutex_);
  identity_ = connection->identity();
  description_ = source_;
  status_.state = CameraState::starting;
  status_.text = "camera starting";
  status_.requested_fps = connection->requested_fps();
  status_.measured_fps = 0;
  connection_ = std::move(connection);
}

void LibcameraCamera::disconnect(const std::string& text) {
  std::shared_ptr<LibcameraConnection> gone;  // closed outside the lock
  const MutexLock lock(mutex_);
  gone.swap(connection_);
  status_.state = CameraState::disconnected;
  status_.text = text;
  status_.measured_fps = 0;
}

void LibcameraCamera::start_manager_anew() {
  manager_ = nullptr;  // there is one at a time; another thread that still holds it keeps it
  while (!manager_) {
    try {
      manager_ = libcamera_manager();
    } catch (const InputError& error) {
      log::debug(error.what());
      MutexLock lock(signal_->mutex);
      signal_->condition.wait_for(signal_->mutex, kLookAgain,
                                  [this]() PARALLAX_REQUIRES(signal_->mutex) { return signal_->stopped; });
      if (signal_->stopped) return;
    }
  }
}

void LibcameraCamera::look_for_camera() {
  {
    MutexLock lock(signal_->mutex);
    signal_->condition.wait_for(signal_->mutex, kLookAgain,
                                [this]() PARALLAX_REQUIRES(signal_->mutex) { return signal_->stopped; });
    if (signal_->stopped) return;
  }
  auto camera = find(source_);
  if (!camera) {
    // It may have missed that a camera came back (a device that appears while another part of it is still being made):
    // one that is started anew looks at everything there is.
    if (++looks_in_vain_ % kLooksBeforeAnew == 0) start_manager_anew();
    return;
  }
  looks_in_vain_ = 0;
  std::string problem;
  try {
    auto connection = std::make_shared<LibcameraConnection>(manager_, std::move(camera), options_, signal_);
    if (connection->width() == width_ && connection->height() == height_) return begin(std::move(connection));
    problem = connection->source() + " offers no pictures of " + to_string(ImageSize{width_, height_}) +
              ", as the camera before it";
  } catch (const InputError& error) {
    problem = error.what();
  }
  const MutexLock lock(mutex_);
  status_.text = std::string(kDisconnected) + " (" + problem + ")";
}

std::optional<Frame> LibcameraCamera::next() {
  while (!stopped_) {
    const auto connection = current();
    if (!connection) {
      look_for_camera();
      continue;
    }
    libcamera::Request* request = connection->take(kLookAgain);
    if (connection->is_gone()) {
      disconnect(kDisconnected);
      continue;
    }
    if (request == nullptr) {
      if (now() - heard_ > kSilence) disconnect("the camera sends no pictures: starting it again");
      continue;
    }
    heard_ = now();
    auto frame = decode(*connection, request);
    if (frame && options_.tracking_profile && !held_) {
      if (!first_time_) first_time_ = frame->time;
      if (frame->time - *first_time_ >= kSettle) {
        connection->hold_settled_values(request);
        held_ = true;
      }
    }
    connection->give_back(request);
    if (!frame) continue;
    const MutexLock lock(mutex_);
    status_.state = CameraState::streaming;
    status_.measured_fps = connection->measured_fps();
    status_.text.clear();
    return frame;
  }
  disconnect("camera stopped");
  return std::nullopt;
}

std::optional<Frame> LibcameraCamera::decode(LibcameraConnection& connection, libcamera::Request* request) {
  const std::uint64_t skipped = connection.take_skipped();
  next_index_ += static_cast<int>(skipped);
  {
    const MutexLock lock(mutex_);
    status_.skipped += skipped;
  }
  Frame frame;
  frame.index = next_index_++;
  bool damaged = false;
  const RawPicture picture = connection.picture(request, &frame.time, &damaged);
  const std::string problem = damaged ? "the driver reports a damaged frame"
                                      : decode_picture(picture, &frame.grey, options_.colour ? &frame.colour : nullptr);
  if (!problem.empty()) {
    warn(frame.index, source_ + ": skipped: " + problem);
    return std::nullopt;
  }
  if (frame.time <= last_time_) frame.time = std::max(now(), last_time_ + Timestamp(1));
  last_time_ = frame.time;
  return frame;
}

void LibcameraCamera::stop() {
  stopped_ = true;
  {
    const MutexLock lock(signal_->mutex);
    signal_->stopped = true;
  }
  signal_->condition.notify_all();
  if (const auto connection = current()) connection->restore();
}

}  // namespace

std::unique_ptr<LiveCamera> open_libcamera_camera(const std::string& name, const LiveCameraOptions& options) {
  return std::make_unique<LibcameraCamera>(name, options);
}

std::vector<CameraInfo> list_libcamera_cameras() {
  std::vector<CameraInfo> cameras;
  try {
    const auto manager = libcamera_manager();
    for (const auto& camera : manager->cameras()) {
      CameraInfo info;
      info.source = "libcamera:" + camera->id();
      info.name = libcamera_product(*camera);
      info.bus = camera->id();
      if (const auto configuration = camera->generateConfiguration({libcamera::StreamRole::Viewfinder});
          configuration && !configuration->empty()) {
        info.formats = libcamera_formats(configuration->at(0));
      }
      for (const auto& control : libcamera_controls(*camera)) info.controls.push_back(control.control);
      cameras.push_back(std::move(info));
    }
  } catch (const InputError& error) {
    log::debug(error.what());
  }
  return cameras;
}

}  // namespace parallax

#endif  // PARALLAX_HAVE_LIBCAMERA
