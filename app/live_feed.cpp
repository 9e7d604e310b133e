#include "app/live_feed.h"

#include <atomic>
#include <exception>
#include <utility>

namespace parallax {

namespace {
// Enough to bridge a session's start; the session keeps the newest two itself.
constexpr std::size_t kTapQueue = 4;
constexpr std::size_t kMessagesKept = 20;
}  // namespace

class LiveFeed::Tap final : public LiveCamera {
 public:
  explicit Tap(const LiveSource& source) : source_(source), queue_(kTapQueue) {}

  void push(const Frame& frame) {
    if (queue_.push_drop_oldest(frame)) ++skipped_;
  }
  std::optional<Frame> next() override { return queue_.pop(); }
  void stop() override {
    queue_.close();
    queue_.clear();
  }
  void end() { queue_.close(); }

  std::vector<SourceWarning> take_warnings() override { return {}; }  // the feed takes them
  double frames_per_second() const override { return source_.frames->frames_per_second(); }
  std::string description() const override { return source_.frames->description(); }
  std::optional<CameraModel> calibration() const override { return source_.lens; }
  CameraStatus status() const override {
    CameraStatus status = source_.camera != nullptr ? source_.camera->status() : CameraStatus{};
    status.skipped += skipped_;
    return status;
  }
  std::vector<CameraControl> controls() override {
    return source_.camera != nullptr ? source_.camera->controls() : std::vector<CameraControl>{};
  }
  void set_control(const std::string& name, std::int64_t value) override {
    if (source_.camera != nullptr) source_.camera->set_control(name, value);
  }
  int width() const override { return source_.width; }
  int height() const override { return source_.height; }
  std::string identity() const override { return source_.identity; }

 private:
  LiveSource source_;
  BoundedQueue<Frame> queue_;
  std::atomic<std::uint64_t> skipped_{0};
};

LiveFeed::LiveFeed(LiveSource source) : source_(std::move(source)) {
  thread_ = std::jthread([this](std::stop_token stop) {
    std::string failure;
    try {
      read(stop);
    } catch (const std::exception& e) {
      failure = e.what();
    }
    MutexLock lock(mutex_);
    if (!failure.empty()) messages_.push_back(failure);
    ended_ = true;
    if (tap_) tap_->end();
  });
}

LiveFeed::~LiveFeed() {
  thread_.request_stop();
  source_.stop();
  thread_.join();
}

void LiveFeed::read(std::stop_token stop) {
  std::optional<Timestamp> first;
  const auto start = SteadyClock::now();
  Mutex mutex;
  std::condition_variable_any wake;
  while (!stop.stop_requested()) {
    auto frame = source_.frames->next();
    for (SourceWarning& warning : source_.frames->take_warnings()) {
      MutexLock lock(mutex_);
      if (messages_.size() < kMessagesKept) messages_.push_back(std::move(warning.text));
    }
    if (!frame) return;
    if (source_.camera == nullptr) {
      if (!first) first = frame->time;
      MutexLock lock(mutex);
      wake.wait_until(mutex, stop, start + (frame->time - *first), [] { return false; });
    }
    publish(std::move(*frame));
  }
}

void LiveFeed::publish(Frame frame) {
  const auto shared = std::make_shared<const Frame>(std::move(frame));
  {
    MutexLock lock(mutex_);
    newest_ = shared;
    if (tap_) tap_->push(*shared);
  }
  arrived_.notify_all();
}

std::shared_ptr<const Frame> LiveFeed::wait_for_other(const std::shared_ptr<const Frame>& than,
                                                      std::chrono::milliseconds at_most) const {
  MutexLock lock(mutex_);
  const bool came = arrived_.wait_for(mutex_, at_most, [&]() PARALLAX_REQUIRES(mutex_) { return newest_ != than; });
  return came ? newest_ : nullptr;
}

std::shared_ptr<const Frame> LiveFeed::newest() const {
  MutexLock lock(mutex_);
  return newest_;
}

std::shared_ptr<LiveCamera> LiveFeed::tap() {
  auto tap = std::make_shared<Tap>(source_);
  MutexLock lock(mutex_);
  if (tap_) tap_->end();
  tap_ = tap;
  if (ended_) tap->end();
  return tap;
}

CameraStatus LiveFeed::status() const {
  if (source_.camera != nullptr) return source_.camera->status();
  CameraStatus status;
  status.state = newest() ? CameraState::streaming : CameraState::starting;
  status.requested_fps = source_.frames->frames_per_second();
  return status;
}

bool LiveFeed::ended() const {
  MutexLock lock(mutex_);
  return ended_;
}

std::vector<std::string> LiveFeed::take_messages() {
  MutexLock lock(mutex_);
  return std::exchange(messages_, {});
}

}  // namespace parallax
