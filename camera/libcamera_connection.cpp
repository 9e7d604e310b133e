#ifdef PARALLAX_HAVE_LIBCAMERA

#include "camera/libcamera_connection.h"

#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>

#include "camera/image_file.h"
#include "camera/v4l2_controls.h"
#include "camera/v4l2_formats.h"
#include "core/error.h"

namespace parallax {
namespace {

namespace lc = libcamera;

constexpr unsigned int kBuffers = 4;
constexpr std::chrono::milliseconds kRestoreWait{300};  // a few frames
constexpr char kBusy[] = ": busy: another program is using the camera; close it and try again";
constexpr unsigned int kMaxLost = 1000;
constexpr Timestamp kSettle = std::chrono::seconds(1);

}  // namespace

LibcameraConnection::LibcameraConnection(std::shared_ptr<lc::CameraManager> manager, std::shared_ptr<lc::Camera> camera,
                                         const LiveCameraOptions& options, std::shared_ptr<LibcameraSignal> signal)
    : manager_(std::move(manager)),
      camera_(std::move(camera)),
      signal_(std::move(signal)),
      to_settle_(options.tracking_profile) {
  facts_.source = facts_.description = "libcamera:" + camera_->id();
  try {
    acquire();
    configure(options);
    allocate();
    start(options);
  } catch (...) {
    release();
    throw;
  }
}

LibcameraConnection::~LibcameraConnection() {
  restore();
  release();
}

void LibcameraConnection::acquire() {
  const int error = camera_->acquire();
  if (error == -EBUSY) throw InputError(facts_.source + kBusy);
  if (error != 0)
    throw InputError(facts_.source + ": no such camera: is it plugged in? `parallax cameras` lists what is there");
  acquired_ = true;
  facts_.identity = libcamera_identity(*camera_);
  known_controls_ = libcamera_controls(*camera_);
}

void LibcameraConnection::configure(const LiveCameraOptions& options) {
  configuration_ = camera_->generateConfiguration({lc::StreamRole::Viewfinder});
  if (!configuration_ || configuration_->empty()) throw InputError(facts_.source + ": has no stream to look at");
  auto& stream = configuration_->at(0);
  const auto formats = libcamera_formats(stream, {options.width, options.height});
  for (const auto& mode : rank_modes(formats, options)) {
    stream.pixelFormat = libcamera_format_of(mode.format);
    stream.size = lc::Size(static_cast<unsigned int>(mode.width), static_cast<unsigned int>(mode.height));
    stream.bufferCount = kBuffers;
    // An adjusted configuration is as good, if it is still one that can be used.
    if (configuration_->validate() == lc::CameraConfiguration::Invalid) continue;
    const auto format = pixel_format_of(stream.pixelFormat);
    const ImageSize size{static_cast<int>(stream.size.width), static_cast<int>(stream.size.height)};
    if (!format || !image_size_problem(size).empty()) continue;
    const int error = camera_->configure(configuration_.get());
    if (error == -EBUSY) throw InputError(facts_.source + kBusy);
    if (error != 0) continue;
    format_ = *format;
    facts_.mode = fourcc_text(fourcc_of(format_)) + " " + to_string(size);
    facts_.width = size.width;
    facts_.height = size.height;
    stride_ = format_ == PixelFormat::mjpeg ? 0 : stream.stride;
    stream_ = stream.stream();
    return;
  }
  throw InputError(facts_.source + ": no usable format: offers " + format_summary(formats) + ", expected one of " +
                   known_pixel_formats());
}

void LibcameraConnection::allocate() {
  allocator_ = std::make_unique<lc::FrameBufferAllocator>(camera_);
  if (allocator_->allocate(stream_) < 0) throw InputError(facts_.source + ": has no memory for pictures");
  std::map<int, std::size_t> lengths;
  for (const auto& buffer : allocator_->buffers(stream_)) {
    for (const auto& plane : buffer->planes()) {
      const std::size_t offset = plane.offset == lc::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
      auto& length = lengths[plane.fd.get()];
      length = std::max(length, offset + plane.length);
    }
    auto request = camera_->createRequest();
    if (!request || request->addBuffer(stream_, buffer.get()) != 0) {
      throw InputError(facts_.source + ": takes no request for a picture");
    }
    requests_.push_back(std::move(request));
  }
  for (const auto& [fd, length] : lengths) {
    const void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) throw InputError(facts_.source + ": its memory for pictures cannot be mapped");
    memory_[fd] = {static_cast<const std::uint8_t*>(memory), length};
  }
}

void LibcameraConnection::start(const LiveCameraOptions& options) {
  camera_->requestCompleted.connect(this, &LibcameraConnection::on_completed);
  camera_->disconnected.connect(this, &LibcameraConnection::on_disconnected);
  lc::ControlList first(camera_->controls());
  if (has(lc::controls::FrameDurationLimits.id())) {
    const auto microseconds = static_cast<std::int64_t>(std::llround(1e6 / options.fps));
    const std::array<std::int64_t, 2> limits{microseconds, microseconds};
    first.set(lc::controls::FrameDurationLimits, lc::Span<const std::int64_t, 2>(limits));
    facts_.fps = options.fps;
  }
  if (options.tracking_profile && has(lc::controls::Sharpness.id())) {
    first.set(lc::controls::Sharpness.id(), camera_->controls().at(lc::controls::Sharpness.id()).min());
  }
  if (const int error = camera_->start(&first); error != 0) {
    throw InputError(facts_.source + (error == -EBUSY ? kBusy : ": cannot be started"));
  }
  for (const auto& request : requests_) queue(request.get());
}

void LibcameraConnection::release() {
  {
    const MutexLock lock(signal_->mutex);
    closing_ = true;
    newest_ = nullptr;
  }
  if (acquired_) {
    camera_->stop();  // returns when no callback runs any more
    camera_->requestCompleted.disconnect(this);
    camera_->disconnected.disconnect(this);
  }
  requests_.clear();
  for (const auto& [fd, memory] : memory_) ::munmap(const_cast<std::uint8_t*>(memory.data()), memory.size());
  memory_.clear();
  allocator_.reset();
  configuration_.reset();
  if (acquired_) camera_->release();
  acquired_ = false;
}

void LibcameraConnection::queue(lc::Request* request) {
  {
    const MutexLock lock(signal_->mutex);
    if (gone_ || closing_) return;
    for (const auto& [id, value] : pending_) request->controls().set(id, value);
    pending_.clear();
  }
  signal_->condition.notify_all();  // restore() waits for this
  camera_->queueRequest(request);
}

void LibcameraConnection::on_completed(lc::Request* request) {
  if (request->status() == lc::Request::RequestCancelled) return;
  lc::Request* older = nullptr;
  {
    const MutexLock lock(signal_->mutex);
    if (closing_) return;
    older = newest_;
    newest_ = request;
    if (older != nullptr) ++skipped_;
    const auto& metadata = request->findBuffer(stream_)->metadata();
    unsigned int lost = 0;
    if (last_sequence_ && metadata.sequence > *last_sequence_) lost = metadata.sequence - *last_sequence_ - 1;
    if (lost > kMaxLost) lost = 0;
    skipped_ += static_cast<int>(lost);
    last_sequence_ = metadata.sequence;
  }
  signal_->condition.notify_all();
  if (older != nullptr) give_back(older);
}

void LibcameraConnection::on_disconnected() {
  {
    const MutexLock lock(signal_->mutex);
    gone_ = true;
    newest_ = nullptr;
  }
  signal_->condition.notify_all();
}

CameraArrival LibcameraConnection::next(std::chrono::milliseconds wait) {
  CameraArrival arrival;
  {
    const MutexLock lock(signal_->mutex);
    signal_->condition.wait_for(signal_->mutex, wait, [this]() PARALLAX_REQUIRES(signal_->mutex) {
      return newest_ != nullptr || gone_ || signal_->stopped;
    });
    arrival.skipped = std::exchange(skipped_, 0);
    if (gone_) arrival.kind = CameraArrival::Kind::gone;
    if (gone_ || signal_->stopped) return arrival;
    taken_ = std::exchange(newest_, nullptr);
  }
  if (taken_ == nullptr) return arrival;
  sync(taken_, true);
  if (taken_->findBuffer(stream_)->metadata().status != lc::FrameMetadata::FrameSuccess) {
    arrival.damaged = 1;
    give_back();
    return arrival;
  }
  fill(&arrival);
  return arrival;
}

void LibcameraConnection::give_back() {
  if (taken_ != nullptr) give_back(std::exchange(taken_, nullptr));
}

void LibcameraConnection::give_back(lc::Request* request) {
  sync(request, false);
  request->reuse(lc::Request::ReuseBuffers);
  queue(request);
}

// Memory that a device wrote and a processor reads may have to be made coherent (dma-buf documentation of the kernel).
void LibcameraConnection::sync(lc::Request* request, bool begin) const {
  dma_buf_sync what{};
  what.flags = DMA_BUF_SYNC_READ | (begin ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END);
  for (const auto& plane : request->findBuffer(stream_)->planes()) ::ioctl(plane.fd.get(), DMA_BUF_IOCTL_SYNC, &what);
}

std::span<const std::uint8_t> LibcameraConnection::bytes_of(const lc::FrameBuffer::Plane& plane,
                                                            std::size_t used) const {
  const auto memory = memory_.at(plane.fd.get());
  const std::size_t offset = plane.offset == lc::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
  return memory.subspan(offset, std::min<std::size_t>(used, plane.length));
}

void LibcameraConnection::fill(CameraArrival* arrival) const {
  const lc::FrameBuffer& buffer = *taken_->findBuffer(stream_);
  const auto& metadata = buffer.metadata();
  arrival->kind = CameraArrival::Kind::picture;
  arrival->time = Timestamp(static_cast<Timestamp::rep>(metadata.timestamp));
  RawPicture& picture = arrival->picture;
  picture.format = format_;
  picture.width = facts_.width;
  picture.height = facts_.height;
  picture.stride = stride_;
  picture.bytes = bytes_of(buffer.planes()[0], metadata.planes()[0].bytesused);
  if (format_ == PixelFormat::nv12 && buffer.planes().size() > 1 && metadata.planes().size() > 1) {
    picture.chroma = bytes_of(buffer.planes()[1], metadata.planes()[1].bytesused);
  }
}

std::vector<CameraControl> LibcameraConnection::controls() const {
  const MutexLock lock(signal_->mutex);
  std::vector<CameraControl> out;
  for (const auto& known : known_controls_) {
    out.push_back(known.control);
    if (const auto set = set_.find(known.id); set != set_.end()) out.back().value = set->second;
  }
  return out;
}

void LibcameraConnection::set_control(const std::string& name, std::int64_t value) {
  require_control(facts_.source, controls(), name, value);
  const MutexLock lock(signal_->mutex);
  for (const auto& known : known_controls_) {
    if (known.control.name != name) continue;
    pending_[known.id] = known.to_value(value);
    set_[known.id] = value;
    changed_.push_back(known.id);
  }
}

void LibcameraConnection::restore() {
  const MutexLock lock(signal_->mutex);
  if (changed_.empty() || gone_ || closing_) return;
  for (const auto& known : known_controls_) {
    if (std::find(changed_.begin(), changed_.end(), known.id) == changed_.end()) continue;
    pending_[known.id] = known.to_value(known.control.default_value);
  }
  changed_.clear();
  signal_->condition.wait_for(signal_->mutex, kRestoreWait,
                              [this]() PARALLAX_REQUIRES(signal_->mutex) { return pending_.empty() || gone_; });
}

template <class Control, class Value>
void LibcameraConnection::set_pending(const Control& control, const Value& value) {
  if (!has(control.id())) return;
  pending_[control.id()] = lc::ControlValue(value);
  changed_.push_back(control.id());
}

std::optional<std::string> LibcameraConnection::settle(const Frame& frame) {
  if (!to_settle_ || taken_ == nullptr) return std::nullopt;
  if (!settling_since_) settling_since_ = frame.time;
  if (frame.time - *settling_since_ < kSettle) return std::nullopt;
  to_settle_ = false;
  hold_settled_values(taken_);
  return std::nullopt;
}

void LibcameraConnection::hold_settled_values(lc::Request* request) {
  const auto& report = request->metadata();
  const auto exposure = report.get(lc::controls::ExposureTime);
  const auto gain = report.get(lc::controls::AnalogueGain);
  const auto colour = report.get(lc::controls::ColourGains);
  const auto lens = report.get(lc::controls::LensPosition);
  const MutexLock lock(signal_->mutex);
  if (exposure && has(lc::controls::ExposureTime.id())) {
    set_pending(lc::controls::AeEnable, false);
    set_pending(lc::controls::ExposureTime, *exposure);
    if (gain) set_pending(lc::controls::AnalogueGain, *gain);
  }
  if (colour && has(lc::controls::ColourGains.id())) {
    set_pending(lc::controls::AwbEnable, false);
    set_pending(lc::controls::ColourGains, *colour);
  }
  if (has(lc::controls::AfMode.id())) {
    set_pending(lc::controls::AfMode, static_cast<std::int32_t>(lc::controls::AfModeManual));
    if (lens) set_pending(lc::controls::LensPosition, *lens);
  }
}

}  // namespace parallax

#endif  // PARALLAX_HAVE_LIBCAMERA
