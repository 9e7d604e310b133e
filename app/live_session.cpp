#include "app/live_session.h"

#include <condition_variable>
#include <deque>
#include <utility>
#include <vector>

#include "app/session_engine.h"
#include "app/session_recorder.h"
#include "camera/live_camera.h"

namespace parallax {
namespace {

// The rate of tracking is that of the last so many seconds.
constexpr double kRateWindow_s = 1.0;

// Frames a second, of when frames were done.
class RateMeter {
 public:
  double tick() {
    const auto now = SteadyClock::now();
    times_.push_back(now);
    while (times_.size() > 2 && std::chrono::duration<double>(now - times_.front()).count() > kRateWindow_s)
      times_.pop_front();
    const double span = std::chrono::duration<double>(now - times_.front()).count();
    return span > 0 ? static_cast<double>(times_.size() - 1) / span : 0;
  }

 private:
  std::deque<SteadyClock::time_point> times_;
};

}  // namespace

struct LiveSession::Implementation {
  Implementation(std::shared_ptr<FrameSource> frames, const CameraModel& camera, const RunOptions& options,
                 std::unique_ptr<SessionRecorder> session_recorder, std::function<void()> stop)
      : source(std::move(frames)),
        recorder(std::move(session_recorder)),
        stop_source(std::move(stop)),
        engine(source.get(), camera, options, recorder.get()),
        key_presses(options) {}

  std::shared_ptr<FrameSource> source;
  std::unique_ptr<SessionRecorder> recorder;
  std::function<void()> stop_source;
  SessionEngine engine;
  KeyPresses key_presses;  // tracking thread
  std::atomic<bool> key_pressed{false};
  RateMeter rate;  // tracking thread

  mutable Mutex mutex;
  mutable std::condition_variable_any newer;
  std::shared_ptr<const LiveFrame> newest PARALLAX_GUARDED_BY(mutex);
  bool tracking_ended PARALLAX_GUARDED_BY(mutex) = false;
  std::string tracking_failure PARALLAX_GUARDED_BY(mutex);
  bool engine_failure_told PARALLAX_GUARDED_BY(mutex) = false;
  std::exception_ptr tracking_exception PARALLAX_GUARDED_BY(mutex);

  std::jthread tracking;

  void track() {
    try {
      engine.track_all(
          [this](int frame) {
            const bool due = key_presses.at(frame);
            return key_pressed.exchange(false) || due;
          },
          [this](const Frame& frame, const TrackingResult& tracked,
                 const std::shared_ptr<const TrackingSnapshot>& map) {
            auto made = std::make_shared<LiveFrame>();
            made->frame = frame;
            made->tracked = tracked;
            made->map = map;
            made->frames_per_second = rate.tick();
            {
              MutexLock lock(mutex);
              newest = std::move(made);
            }
            newer.notify_all();
          });
    } catch (...) {
      MutexLock lock(mutex);
      tracking_exception = std::current_exception();
      try {
        std::rethrow_exception(tracking_exception);
      } catch (const std::exception& e) {
        tracking_failure = e.what();
      } catch (...) {
        tracking_failure = "internal error: unknown exception";
      }
    }
    {
      MutexLock lock(mutex);
      tracking_ended = true;
    }
    newer.notify_all();
  }

  template <class Request>
  std::future<EditReply> send(Request request) {
    auto reply = request.reply.get_future();
    if (engine.inbox().closed()) {
      request.reply.set_value({false, "the session has ended"});
    } else {
      engine.inbox().push(std::move(request));
    }
    return reply;
  }

  void end_threads() {
    if (stop_source) stop_source();
    engine.stop_tracking();
    if (tracking.joinable()) tracking.join();
  }
};

LiveSession::LiveSession(std::shared_ptr<FrameSource> source, const CameraModel& camera, const RunOptions& options,
                         std::unique_ptr<SessionRecorder> recorder, std::function<void()> stop_source)
    : implementation_(std::make_unique<Implementation>(std::move(source), camera, options, std::move(recorder),
                                                       std::move(stop_source))) {
  Implementation& my = *implementation_;
  my.engine.start(dynamic_cast<const LiveCamera*>(my.source.get()) == nullptr);
  my.tracking = std::jthread([&my] { my.track(); });
}

LiveSession::~LiveSession() {
  if (implementation_) implementation_->end_threads();
}

std::shared_ptr<const LiveFrame> LiveSession::newest() const {
  MutexLock lock(implementation_->mutex);
  return implementation_->newest;
}

std::shared_ptr<const LiveFrame> LiveSession::wait_for_newer(int index, std::chrono::milliseconds at_most) const {
  const Implementation& my = *implementation_;
  const auto is_newer = [&]() PARALLAX_REQUIRES(my.mutex) { return my.newest && my.newest->frame.index > index; };
  MutexLock lock(my.mutex);
  my.newer.wait_for(my.mutex, at_most, [&]() PARALLAX_REQUIRES(my.mutex) { return is_newer() || my.tracking_ended; });
  return is_newer() ? my.newest : nullptr;
}

void LiveSession::press_initialise() { implementation_->key_pressed = true; }

// A full inbox makes room within moments, since what waits stops the solve in progress. A session that has failed or
// was stopped answers itself.
std::future<void> LiveSession::reset() {
  ResetRequest request;
  auto done = request.done.get_future();
  if (implementation_->engine.inbox().closed()) {
    request.done.set_value();
  } else {
    implementation_->engine.inbox().push(std::move(request));
  }
  return done;
}

std::future<EditReply> LiveSession::edit(const ScaleEdit& edit) {
  ScaleRequest request;
  request.factor = edit.factor;
  return implementation_->send(std::move(request));
}

std::future<EditReply> LiveSession::edit(const PlaneEdit& edit) {
  PlaneRequest request;
  request.seed = edit.seed;
  return implementation_->send(std::move(request));
}

MapperInbox& LiveSession::inbox() { return implementation_->engine.inbox(); }

Map LiveSession::copy_map() const {
  return implementation_->engine.map().read([](const Map& map) { return map; });
}

MapCopy LiveSession::copy_map_and_world() const { return implementation_->engine.map().copy(); }

LiveSession::Statistics LiveSession::statistics() const {
  const Implementation& my = *implementation_;
  Statistics out;
  out.frames_read = my.engine.frames_read();
  out.frames_dropped = my.engine.frames_dropped();
  if (my.recorder) {
    out.recorder_frames_dropped = my.recorder->frames_dropped();
    out.recording = my.recorder->recording();
  }
  // Ended when the last frame has been tracked too.
  MutexLock lock(my.mutex);
  out.source_ended = my.engine.source_ended() && my.tracking_ended;
  return out;
}

std::string LiveSession::take_failure() {
  Implementation& my = *implementation_;
  if (my.recorder) {
    std::string failure = my.recorder->take_failure();
    if (!failure.empty()) return failure;
  }
  MutexLock lock(my.mutex);
  if (!my.tracking_failure.empty()) return std::exchange(my.tracking_failure, {});
  if (my.engine_failure_told) return "";
  std::string failure = my.engine.failure();
  my.engine_failure_told = !failure.empty();
  return failure;
}

RunResult LiveSession::stop() {
  Implementation& my = *implementation_;
  my.end_threads();
  {
    MutexLock lock(my.mutex);
    if (my.tracking_exception) std::rethrow_exception(my.tracking_exception);
  }
  return my.engine.finish();
}

}  // namespace parallax
