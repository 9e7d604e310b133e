#include "app/run_session.h"

#include <algorithm>
#include <stop_token>
#include <thread>

#include "core/error.h"

namespace parallax {
namespace {

constexpr std::size_t kInboxCapacity = 32;
constexpr std::size_t kLiveQueue = 2;
// After the last frame the mapper may finish what it is at, for so long.
constexpr double kRealtimeFinish_s = 3.0;

// The two key presses of the options. One whose own frame never arrives (unreadable, dropped) goes with the next that
// does.
class KeyPresses {
 public:
  explicit KeyPresses(const RunOptions& options) {
    if (options.key_presses) due_ = {options.key_presses->second, options.key_presses->first};
  }
  // Whether the key is pressed at this frame; frames come in order.
  bool at(int frame) {
    if (due_.empty() || frame < due_.back()) return false;
    due_.pop_back();
    return true;
  }

 private:
  std::vector<int> due_;  // the next one last
};

void check_size(const Frame& frame, const CameraModel& camera, const FrameSource& source) {
  if (frame.grey.cols == camera.width() && frame.grey.rows == camera.height()) return;
  throw InputError(source.description() + ": the calibration is for images of " + std::to_string(camera.width()) + "x" +
                   std::to_string(camera.height()) + ", found images of " + std::to_string(frame.grey.cols) + "x" +
                   std::to_string(frame.grey.rows));
}

void keep(TrackingResult result, RunResult* out) {
  result.points.clear();
  result.points.shrink_to_fit();
  result.trails.clear();
  result.trails.shrink_to_fit();
  out->frames.push_back(std::move(result));
}

void collect_warnings(FrameSource* source, RunResult* out) {
  for (SourceWarning& w : source->take_warnings()) out->warnings.push_back(std::move(w));
}

void run_lockstep(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                  const FrameObserver& observer, SharedMap* map, RunResult* out) {
  MapperInbox inbox(kInboxCapacity);
  Mapper mapper(camera, options.mapper, map, &inbox);
  Tracker tracker(camera, options.tracker, !options.key_presses, map, &inbox);
  KeyPresses key_presses(options);
  while (auto frame = source->next()) {
    check_size(*frame, camera, *source);
    ++out->frames_read;
    TrackingResult result = tracker.track(*frame, key_presses.at(frame->index));
    while (mapper.step()) {
    }
    if (observer) observer(*frame, result, map->snapshot()->plane);
    keep(std::move(result), out);
    collect_warnings(source, out);
  }
  out->mapper = mapper.statistics();
}

void run_realtime(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                  const FrameObserver& observer, SharedMap* map, RunResult* out) {
  MapperInbox inbox(kInboxCapacity);
  Mapper mapper(camera, options.mapper, map, &inbox);
  Tracker tracker(camera, options.tracker, !options.key_presses, map, &inbox);
  KeyPresses key_presses(options);
  BoundedQueue<Frame> arriving(kLiveQueue);
  int dropped = 0;
  std::exception_ptr reader_failure, mapper_failure;

  std::jthread mapping([&](std::stop_token stop) {
    try {
      mapper.run(stop);
    } catch (...) {
      mapper_failure = std::current_exception();
      inbox.close();
      arriving.close();
    }
  });
  // Frames arrive at their time stamps (over the speed), whether or not the tracker is ready; the newest is kept.
  std::jthread camera_thread([&](std::stop_token stop) {
    try {
      std::optional<Timestamp> first;
      const auto start = SteadyClock::now();
      Mutex mutex;
      std::condition_variable_any wake;
      while (!stop.stop_requested()) {
        auto frame = source->next();
        if (!frame) break;
        check_size(*frame, camera, *source);
        if (!first) first = frame->time;
        const std::chrono::duration<double, std::nano> since_first = frame->time - *first;
        const auto due = start + std::chrono::duration_cast<SteadyClock::duration>(since_first / options.speed);
        {
          MutexLock lock(mutex);
          wake.wait_until(mutex, stop, due, [] { return false; });
        }
        ++out->frames_read;
        if (arriving.push_drop_oldest(std::move(*frame))) ++dropped;
      }
    } catch (...) {
      reader_failure = std::current_exception();
    }
    arriving.close();
  });
  while (auto frame = arriving.pop()) {
    TrackingResult result = tracker.track(*frame, key_presses.at(frame->index));
    if (observer) observer(*frame, result, map->snapshot()->plane);
    keep(std::move(result), out);
  }
  camera_thread.request_stop();  // when the mapper failed, the rest of the recording is not waited for
  camera_thread.join();
  collect_warnings(source, out);
  // The tracker has stopped: no new keyframes come, so the mapper finishes its work within a limit.
  const auto end = SteadyClock::now() +
                   std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(kRealtimeFinish_s));
  mapping.request_stop();
  mapping.join();
  if (reader_failure) std::rethrow_exception(reader_failure);
  if (mapper_failure) std::rethrow_exception(mapper_failure);
  while (SteadyClock::now() < end && mapper.step()) {
  }
  out->frames_dropped = dropped;
  out->mapper = mapper.statistics();
}

}  // namespace

RunResult run_session(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                      const FrameObserver& observer) {
  RunResult out;
  SharedMap map;
  const auto start = SteadyClock::now();
  if (options.pace == Pace::lockstep) {
    run_lockstep(source, camera, options, observer, &map, &out);
  } else {
    run_realtime(source, camera, options, observer, &map, &out);
  }
  out.wall_seconds = milliseconds_since(start) * 1e-3;
  collect_warnings(source, &out);
  out.map = map.read([](const Map& m) { return m; });
  const auto snapshot = map.snapshot();
  out.world_from_first = snapshot->world_from_first;
  out.map_version = snapshot->map_version;
  out.lock_times = map.lock_times();
  out.snapshot_waits_ms = map.snapshot_waits_ms();
  return out;
}

}  // namespace parallax
