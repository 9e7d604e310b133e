#include "camera/v4l2_connection.h"

#include <array>
#include <cerrno>

#include "camera/image_file.h"

namespace parallax {
namespace {

constexpr std::uint32_t kMaxLost = 1000;  // a larger gap in the numbers is a driver that counts oddly

}  // namespace

V4l2Connection::V4l2Connection(std::shared_ptr<V4l2System> system, const std::string& path,
                               const LiveCameraOptions& options, std::shared_ptr<WakeEvent> wake)
    : system_(std::move(system)),
      wake_(std::move(wake)),
      device_(std::make_shared<V4l2Device>(system_, path)),
      controls_(device_),
      mode_(set_best_mode(*device_, options)),
      stream_(device_) {
  facts_.source = device_->source();
  facts_.description = device_->source() + " (" + device_->card() + ")";
  facts_.identity = device_->identity();
  facts_.mode = fourcc_text(mode_.code) + " " + to_string(ImageSize{mode_.width, mode_.height});
  facts_.width = mode_.width;
  facts_.height = mode_.height;
  facts_.fps = mode_.rate;
  if (options.tracking_profile) profile_.emplace(&controls_);
}

CameraArrival V4l2Connection::next(std::chrono::milliseconds wait) {
  CameraArrival arrival;
  std::array<pollfd, 2> ready{{{device_->descriptor(), POLLIN, 0}, {wake_->descriptor(), POLLIN, 0}}};
  if (system_->poll(ready, wait) <= 0 || ready[0].revents == 0) return arrival;
  const Taken taken = take_all(&arrival);
  // A descriptor that is ready with nothing to take is that of a stream that has ended.
  const bool broken = (ready[0].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0 && taken.count == 0;
  if (broken || (taken.error != 0 && taken.error != -EAGAIN)) {
    give_back();
    arrival.kind = CameraArrival::Kind::gone;
    return arrival;
  }
  if (!newest_) return arrival;
  // All buffers were full: what came after them was lost, and the newest of them may be old.
  if (taken.count == stream_.buffer_count() && !waited_for_fresh_ && is_stale(*newest_)) {
    waited_for_fresh_ = true;
    give_back();
    ++arrival.skipped;
    return arrival;
  }
  waited_for_fresh_ = false;
  arrival.kind = CameraArrival::Kind::picture;
  arrival.time = newest_->time;
  arrival.picture.format = mode_.format;
  arrival.picture.width = mode_.width;
  arrival.picture.height = mode_.height;
  arrival.picture.stride = mode_.stride;
  arrival.picture.bytes = newest_->bytes;
  return arrival;
}

// Keeps the newest of the filled buffers and hands the others to the driver again.
V4l2Connection::Taken V4l2Connection::take_all(CameraArrival* arrival) {
  Taken taken;
  // At most every buffer once: a fast camera must not keep this from ending.
  while (taken.count < stream_.buffer_count()) {
    V4l2Stream::Buffer buffer;
    taken.error = stream_.take(&buffer);
    if (taken.error < 0) break;
    ++taken.count;
    arrival->skipped += lost_before(buffer.sequence);
    if (buffer.damaged) {
      ++arrival->damaged;
      stream_.give_back(buffer);
      continue;
    }
    if (newest_) {
      ++arrival->skipped;
      give_back();
    }
    newest_ = buffer;
  }
  return taken;
}

void V4l2Connection::give_back() {
  if (newest_) stream_.give_back(*newest_);
  newest_.reset();
}

int V4l2Connection::lost_before(std::uint32_t sequence) {
  std::uint32_t lost = 0;
  if (last_sequence_ && sequence > *last_sequence_) lost = sequence - *last_sequence_ - 1;
  last_sequence_ = sequence;
  return lost > kMaxLost ? 0 : static_cast<int>(lost);
}

bool V4l2Connection::is_stale(const V4l2Stream::Buffer& buffer) const {
  constexpr double intervals = 1.5;
  return mode_.rate > 0 && to_seconds(system_->now() - buffer.time) > intervals / mode_.rate;
}

std::optional<std::string> V4l2Connection::settle(const Frame& frame) {
  return profile_ ? profile_->on_frame(frame.time, frame.grey) : std::nullopt;
}

std::string V4l2Connection::slow_reason(double measured_fps) const {
  return parallax::slow_reason(controls_, measured_fps, mode_.rate);
}

}  // namespace parallax
