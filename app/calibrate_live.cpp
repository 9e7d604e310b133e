#include "app/calibrate_live.h"

#include <chrono>
#include <condition_variable>
#include <stop_token>
#include <thread>

#include "core/check.h"
#include "core/mutex.h"
#include "core/time.h"

namespace parallax {
namespace {

// How often the watch looks at the camera and at the user's wish to end.
constexpr std::chrono::milliseconds kLook{50};

// Says each line once, however often and from wherever it comes.
class Speaker {
 public:
  explicit Speaker(const std::function<void(const std::string&)>& say) : say_(say) {}

  void operator()(const std::string& line) {
    MutexLock lock(mutex_);
    if (line.empty() || line == last_) return;
    last_ = line;
    say_(line);
  }

 private:
  Mutex mutex_;
  const std::function<void(const std::string&)>& say_;
  std::string last_ PARALLAX_GUARDED_BY(mutex_);
};

// Reading waits for the next frame, with no camera for ever: this looks after the rest meanwhile, and ends the reading.
void watch(LiveCamera* camera, const LiveGatheringOptions& options, SteadyClock::time_point end, Speaker* say,
           const std::stop_token& stop) {
  Mutex mutex;
  std::condition_variable_any wake;
  MutexLock lock(mutex);
  bool was_away = false;
  while (!stop.stop_requested()) {
    const CameraStatus status = camera->status();
    const bool away = status.state == CameraState::disconnected;
    if (away && !was_away) (*say)(status.text.empty() ? "camera disconnected" : status.text);
    if (was_away && !away) (*say)("the camera is back");
    was_away = away;
    if (SteadyClock::now() >= end || (options.ended && options.ended())) return camera->stop();
    wake.wait_for(mutex, stop, kLook, [] { return false; });
  }
}

}  // namespace

LiveGathering gather_live_views(LiveCamera* camera, const LiveGatheringOptions& options) {
  PARALLAX_CHECK(options.say, "somebody to tell");
  CalibrationSessionOptions session_options;
  session_options.most_views = options.most_views;
  CalibrationSession session(options.target, camera->width(), camera->height(), session_options);
  Speaker say(options.say);
  LiveGathering out;
  const auto time = std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(options.seconds));
  const SteadyClock::time_point end = SteadyClock::now() + time;
  {
    const std::jthread watcher([&](const std::stop_token& stop) { watch(camera, options, end, &say, stop); });
    while (!session.ready()) {
      const auto frame = camera->next();
      if (!frame) break;
      ++out.frames;
      const CalibrationFrameResult result = session.add_frame(frame->grey, frame->index);
      std::string line = result.text;
      if (result.verdict == FrameVerdict::kept) line += "; next: " + session.wanted_view().text;
      say(line);
    }
  }
  camera->stop();
  out.data = session.data();
  return out;
}

}  // namespace parallax
