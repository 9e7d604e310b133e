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
constexpr unsigned int kMaxLost = 1000;

}  // namespace

LibcameraConnection::LibcameraConnection(std::shared_ptr<lc::CameraManager> manager, std::shared_ptr<lc::Camera> camera,
                                         const LiveCameraOptions& options, std::shared_ptr<LibcameraSignal> signal)
    : manager_(std::move(manager)), camera_(std::move(camera)), signal_(std::move(signal)) {
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
  if (error == -EBUSY) {
    throw InputError(source() + ": busy: another program is using the camera; close it and try again");
  }
  if (error != 0)
    throw InputError(source() + ": no such camera: is it plugged in? `parallax cameras` lists what is there");
  acquired_ = true;
  known_controls_ = libcamera_controls(*camera_);
}

void LibcameraConnection::configure(const LiveCameraOptions& options) {
  configuration_ = camera_->generateConfiguration({lc::StreamRole::Viewfinder});
  if (!configuration_ || configuration_->empty()) throw InputError(source() + ": has no stream to look at");
  auto& stream = configuration_->at(0);
  const auto formats = libcamera_formats(stream);
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
    if (error == -EBUSY) {
      throw InputError(source() + ": busy: another program is using the camera; close it and try again");
    }
    if (error != 0) continue;
    format_ = *format;
    width_ = size.width;
    height_ = size.height;
    stride_ = format_ == PixelFormat::mjpeg ? 0 : stream.stride;
    stream_ = stream.stream();
    return;
  }
  throw InputError(source() + ": no usable format: offers " + format_summary(formats) + ", expected one of " +
                   known_pixel_formats());
}

void LibcameraConnection::allocate() {
  allocator_ = std::make_unique<lc::FrameBufferAllocator>(camera_);
  if (allocator_->allocate(stream_) < 0) throw InputError(source() + ": has no memory for pictures");
  std::map<int, std::size_t> lengths;
  for (const auto& buffer : allocator_->buffers(stream_)) {
    for (const auto& plane : buffer->planes()) {
      const std::size_t offset = plane.offset == lc::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
      auto& length = lengths[plane.fd.get()];
      length = std::max(length, offset + plane.length);
    }
    auto request = camera_->createRequest();
    if (!request || request->addBuffer(stream_, buffer.get()) != 0) {
      throw InputError(source() + ": takes no request for a picture");
    }
    requests_.push_back(std::move(request));
  }
  for (const auto& [fd, length] : lengths) {
    const void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) throw InputError(source() + ": its memory for pictures cannot be mapped");
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
    requested_fps_ = options.fps;
  }
  if (options.tracking_profile && has(lc::controls::Sharpness.id())) {
    first.set(lc::controls::Sharpness.id(), camera_->controls().at(lc::controls::Sharpness.id()).min());
  }
  if (const int error = camera_->start(&first); error != 0) {
    throw InputError(source() + (error == -EBUSY ? ": busy: another program is using the camera; close it and try again"
                                                 : ": cannot be started"));
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
    skipped_ += lost;
    last_sequence_ = metadata.sequence;
    meter_.add(Timestamp(static_cast<Timestamp::rep>(metadata.timestamp)), lost);
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

lc::Request* LibcameraConnection::take(std::chrono::milliseconds wait) {
  MutexLock lock(signal_->mutex);
  signal_->condition.wait_for(signal_->mutex, wait, [this]() PARALLAX_REQUIRES(signal_->mutex) {
    return newest_ != nullptr || gone_ || signal_->stopped;
  });
  if (gone_ || signal_->stopped) return nullptr;
  lc::Request* request = newest_;
  newest_ = nullptr;
  if (request != nullptr) {
    lock.unlock();
    sync(request, true);
  }
  return request;
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

RawPicture LibcameraConnection::picture(lc::Request* request, Timestamp* time, bool* damaged) const {
  const lc::FrameBuffer& buffer = *request->findBuffer(stream_);
  const auto& metadata = buffer.metadata();
  *time = Timestamp(static_cast<Timestamp::rep>(metadata.timestamp));
  *damaged = metadata.status != lc::FrameMetadata::FrameSuccess;
  RawPicture out;
  out.format = format_;
  out.width = width_;
  out.height = height_;
  out.stride = stride_;
  out.bytes = bytes_of(buffer.planes()[0], metadata.planes()[0].bytesused);
  if (format_ == PixelFormat::nv12 && buffer.planes().size() > 1 && metadata.planes().size() > 1) {
    out.chroma = bytes_of(buffer.planes()[1], metadata.planes()[1].bytesused);
  }
  return out;
}

bool LibcameraConnection::is_gone() const {
  const MutexLock lock(signal_->mutex);
  return gone_;
}

std::uint64_t LibcameraConnection::take_skipped() {
  const MutexLock lock(signal_->mutex);
  return std::exchange(skipped_, 0);
}

double LibcameraConnection::measured_fps() const {
  const MutexLock lock(signal_->mutex);
  return meter_.rate();
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
  require_control(source(), controls(), name, value);
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
