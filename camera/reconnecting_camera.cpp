#include "camera/reconnecting_camera.h"

#include <algorithm>
#include <cmath>

#include "camera/image_file.h"
#include "core/error.h"
#include "core/log.h"

namespace parallax {
namespace {

constexpr std::chrono::milliseconds kLookAgain{500};         // for an unplugged camera
constexpr Timestamp kPatience = std::chrono::seconds(10);    // without a good frame
constexpr Timestamp kSecond = std::chrono::seconds(1);       // how often rates and damage are looked at
constexpr Timestamp kMostAhead = std::chrono::seconds(1);    // of a driver's clock; what it expects, not what was
constexpr Timestamp kMostBehind = std::chrono::seconds(60);  // no frame waits for so long
constexpr std::size_t kMaxWarnings = 100;                    // kept for someone who never asks
constexpr char kDisconnected[] = "camera disconnected: plug it in again";
constexpr char kSilent[] = "the camera sends no pictures: starting it again; if that does not help, plug it in again";

}  // namespace

ReconnectingCamera::ReconnectingCamera(std::unique_ptr<CameraBackend> backend, const LiveCameraOptions& options)
    : backend_(std::move(backend)), options_(options) {
  auto connection = connect_first();
  options_.width = connection->facts().width;
  options_.height = connection->facts().height;
  begin(std::move(connection));
}

ReconnectingCamera::~ReconnectingCamera() {
  const MutexLock lock(mutex_);
  connection_.reset();  // before the back end that it came from
}

ReconnectingCamera::Connection ReconnectingCamera::connect_first() {
  std::string problem;
  for (const auto& name : backend_->candidates("")) {
    try {
      return backend_->open(name, options_);
    } catch (const InputError& error) {
      if (problem.empty()) problem = error.what();
    }
  }
  throw InputError(problem.empty() ? backend_->none_found() : problem);
}

ReconnectingCamera::Connection ReconnectingCamera::current() const {
  const MutexLock lock(mutex_);
  return connection_;
}

void ReconnectingCamera::begin(Connection connection) {
  const auto& facts = connection->facts();
  log::debug("camera ", facts.source, " (", facts.identity, "): ", facts.mode, " at ", facts.fps, " frames a second");
  heard_ = good_ = backend_->now();
  meter_ = {};
  between_ = 0;
  second_ = {heard_, 0, 0};
  std::vector<std::pair<std::string, std::int64_t>> wanted;
  {
    const MutexLock lock(mutex_);
    wanted = wanted_controls_;
  }
  for (const auto& [name, value] : wanted) {
    try {
      connection->set_control(name, value);
    } catch (const InputError& error) {
      log::debug(error.what());  // another camera need not have it
    }
  }
  const MutexLock lock(mutex_);
  identity_ = facts.identity;
  description_ = facts.description;
  if (trouble_.empty()) {
    status_.state = CameraState::starting;
    status_.text = "camera starting";
  } else {
    status_.text = trouble_;
  }
  status_.requested_fps = facts.fps;
  connection_ = std::move(connection);
}

void ReconnectingCamera::disconnect(const std::string& text) {
  log::debug(text);
  last_problem_.clear();
  Connection gone;  // closed outside the lock
  const MutexLock lock(mutex_);
  gone.swap(connection_);
  status_.state = CameraState::disconnected;
  status_.text = text;
  status_.measured_fps = 0;
  status_.fps_reason.clear();
}

void ReconnectingCamera::look_again() {
  backend_->wait(kLookAgain);
  if (stopped_) return;
  const auto names = backend_->candidates(identity());
  std::string problem;
  for (const auto& name : names) {
    try {
      Connection connection = backend_->open(name, options_);
      const auto& facts = connection->facts();
      if (facts.width == options_.width && facts.height == options_.height) return begin(std::move(connection));
      problem = facts.source + " offers no pictures of " + to_string(ImageSize{options_.width, options_.height}) +
                ", as the camera before it";
    } catch (const InputError& error) {
      problem = error.what();
    }
  }
  if (names.empty()) trouble_.clear();  // now it is unplugged
  // A device that has just appeared may be refused for a moment, until its permissions are set.
  const bool lasting = !problem.empty() && problem == last_problem_;
  last_problem_ = problem;
  const MutexLock lock(mutex_);
  if (lasting) {
    status_.text = std::string(kDisconnected) + " (" + problem + ")";
  } else if (trouble_.empty()) {
    status_.text = kDisconnected;
  }
}

std::optional<Frame> ReconnectingCamera::next() {
  heard_ = good_ = backend_->now();  // time in which nobody asks does not count
  while (!stopped_) {
    const auto connection = current();
    if (!connection) {
      look_again();
      continue;
    }
    const CameraArrival arrival = connection->next(kLookAgain);
    if (stopped_) {
      connection->give_back();
      break;
    }
    if (!take_stock(arrival)) continue;
    auto frame = decode(arrival);
    if (frame) delivered(*connection, *frame);
    connection->give_back();
    look_at_the_second(*connection);
    if (frame) return frame;
  }
  disconnect("camera stopped");
  return std::nullopt;
}

bool ReconnectingCamera::take_stock(const CameraArrival& arrival) {
  const Timestamp now = backend_->now();
  if (arrival.heard()) heard_ = now;
  if (arrival.damaged > 0) tell_damaged(next_index_, arrival.damaged, "the driver reports a damaged frame");
  next_index_ += arrival.skipped + arrival.damaged;
  between_ += static_cast<std::uint64_t>(arrival.skipped + arrival.damaged);
  {
    const MutexLock lock(mutex_);
    status_.skipped += static_cast<std::uint64_t>(arrival.skipped);
  }
  if (arrival.kind == CameraArrival::Kind::gone) {
    trouble_.clear();
    disconnect(kDisconnected);
    return false;
  }
  if (now - good_ > kPatience && arrival.kind == CameraArrival::Kind::nothing) {
    leave(now - heard_ <= kPatience ? only_damaged() : kSilent);
    return false;
  }
  return arrival.kind == CameraArrival::Kind::picture;
}

// A camera that is there and of no use is connected anew.
void ReconnectingCamera::leave(const std::string& trouble) {
  trouble_ = trouble;
  disconnect(trouble);
}

std::string ReconnectingCamera::only_damaged() const {
  return "the camera sends only damaged pictures (" + last_damage_ +
         "): starting it again; if that does not help, use another cable or port, not a hub";
}

std::optional<Frame> ReconnectingCamera::decode(const CameraArrival& arrival) {
  Frame frame;
  frame.index = next_index_++;
  const std::string problem = decode_picture(arrival.picture, &frame.grey, options_.colour ? &frame.colour : nullptr);
  if (!problem.empty()) {
    ++between_;
    tell_damaged(frame.index, 1, problem);
    if (backend_->now() - good_ > kPatience) leave(only_damaged());
    return std::nullopt;
  }
  frame.time = frame_time(arrival.time);
  return frame;
}

Timestamp ReconnectingCamera::frame_time(Timestamp by_driver) {
  const Timestamp now = backend_->now();
  Timestamp time = by_driver;
  if (time > now + kMostAhead || time < now - kMostBehind) time = now;
  if (time <= last_time_) time = std::max(now, last_time_ + Timestamp(1));
  last_time_ = time;
  return time;
}

void ReconnectingCamera::delivered(CameraConnection& connection, const Frame& frame) {
  good_ = backend_->now();
  trouble_.clear();
  meter_.add(frame.time, std::exchange(between_, 0));
  ++second_.frames;
  if (const auto text = connection.settle(frame)) warn(-1, description() + ": " + *text);
  const MutexLock lock(mutex_);
  if (status_.state != CameraState::streaming) status_.text.clear();
  status_.state = CameraState::streaming;
  status_.measured_fps = meter_.rate();
}

void ReconnectingCamera::look_at_the_second(const CameraConnection& connection) {
  const Timestamp now = backend_->now();
  if (now - second_.begin < kSecond) return;
  const Second past = std::exchange(second_, {now, 0, 0});
  tell_damaged(-1, 0, "");
  const double promised = connection.facts().fps, rate = meter_.rate();
  const std::string reason = meter_.is_settled() ? connection.slow_reason(rate) : "";
  const MutexLock lock(mutex_);
  if (status_.state != CameraState::streaming) return;
  status_.fps_reason = reason;
  status_.text.clear();
  if (past.damaged > 0) {
    status_.text = std::to_string(past.damaged) + " of " + std::to_string(past.damaged + past.frames) +
                   " frames are damaged: use another cable or port, not a hub";
  } else if (!reason.empty()) {
    status_.text = std::to_string(std::lround(rate)) + " frames a second instead of " +
                   std::to_string(std::lround(promised)) + ": " + reason;
  }
}

void ReconnectingCamera::tell_damaged(int frame, int count, const std::string& problem) {
  if (count > 0) {
    if (untold_.count == 0) untold_.frame = frame;
    untold_.count += count;
    untold_.problem = last_damage_ = problem;
    second_.damaged += count;
    const MutexLock lock(mutex_);
    status_.damaged += static_cast<std::uint64_t>(count);
  }
  const Timestamp now = backend_->now();
  if (untold_.count == 0 || now - untold_.told < kSecond) return;
  warn(untold_.frame, description() + ": skipped: " + untold_.problem +
                          (untold_.count > 1 ? " (" + std::to_string(untold_.count) + " frames)" : ""));
  untold_ = {now, 0, -1, ""};
}

void ReconnectingCamera::warn(int frame, const std::string& text) {
  log::debug(text);
  if (warnings_.size() < kMaxWarnings) warnings_.push_back({frame, text});
}

CameraStatus ReconnectingCamera::status() const {
  const MutexLock lock(mutex_);
  return status_;
}

void ReconnectingCamera::stop() {
  stopped_ = true;
  backend_->wake();
  if (const auto connection = current()) connection->restore();
}

std::vector<CameraControl> ReconnectingCamera::controls() {
  const auto connection = current();
  return connection ? connection->controls() : std::vector<CameraControl>();
}

void ReconnectingCamera::set_control(const std::string& name, std::int64_t value) {
  const auto connection = current();
  if (!connection) throw InputError(description() + ": control " + name + " cannot be set: " + kDisconnected);
  connection->set_control(name, value);
  const MutexLock lock(mutex_);
  std::erase_if(wanted_controls_, [&](const auto& wanted) { return wanted.first == name; });
  wanted_controls_.emplace_back(name, value);
}

std::string ReconnectingCamera::identity() const {
  const MutexLock lock(mutex_);
  return identity_;
}

std::string ReconnectingCamera::description() const {
  const MutexLock lock(mutex_);
  return description_;
}

double ReconnectingCamera::frames_per_second() const {
  const MutexLock lock(mutex_);
  return status_.requested_fps > 0 ? status_.requested_fps : options_.fps;
}

}  // namespace parallax
