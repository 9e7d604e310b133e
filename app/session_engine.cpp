#include "app/session_engine.h"

#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include <algorithm>
#include <limits>

#include "app/place_vocabulary.h"
#include "app/session_hash.h"
#include "app/session_recorder.h"
#include "core/error.h"
#include "map/append_bounded.h"
#include "mapper/map_maintenance.h"

namespace parallax {
namespace {

constexpr std::size_t kMapperInbox = 32;
constexpr std::size_t kLiveQueue = 2;
// After the last frame the mapper may finish what it is at, for so long.
constexpr double kRealtimeFinish_s = 3.0;
// Warnings of a source without an end: the newest so many.
constexpr std::size_t kWarningsKept = 1000;

// Memory that was freed between what is still used goes back to the system so often: the images of keyframes that come
// and go would otherwise make a long session larger by a few megabytes every ten minutes. Takes some milliseconds.
constexpr std::chrono::seconds kMemoryInterval{30};

void return_freed_memory() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

RunOptions checked(RunOptions options, const SessionRecorder* recorder) {
  // Which question of a solve was answered with "stop" means something with one solver thread only.
  if (recorder) options.mapper.threads = 1;
  return options;
}

std::unique_ptr<TrackerSchedule> tracker_schedule(const SharedMap* map, MapperInbox* inbox, SessionRecorder* recorder) {
  if (recorder) return recorder->tracker_schedule(map, inbox);
  return std::make_unique<LiveTrackerSchedule>(map, inbox);
}

std::unique_ptr<MapperSchedule> mapper_schedule(MapperInbox* inbox, SessionRecorder* recorder) {
  if (recorder) return recorder->mapper_schedule(inbox);
  return std::make_unique<LiveMapperSchedule>(inbox);
}

bool same_world(const TrackedWorld& world, const TrackingResult& result) {
  return world.map_version == result.map_version && world.world_from_first.s == result.world_from_first.s &&
         world.world_from_first.t == result.world_from_first.t && world.world_from_first.R == result.world_from_first.R;
}

void keep_pose(const TrackingResult& result, RunResult* out) {
  if (!result.camera_from_world) return;
  if (out->worlds.empty() || !same_world(out->worlds.back(), result))
    out->worlds.push_back({result.map_version, result.world_from_first});
  out->poses.push_back({result.time, result.camera_from_world->quaternion(), result.camera_from_world->t,
                        static_cast<int>(out->worlds.size()) - 1});
}

}  // namespace

void FrameCounts::add(const TrackingResult& result) {
  slowest_ms = std::max(slowest_ms, result.times.total);
  slowest_cpu_ms = std::max(slowest_cpu_ms, result.times.cpu);
  if (result.camera_from_world) {
    ++tracked;
    ++(result.quality == TrackingQuality::good ? good : poor);
    if (result.relocalised) ++relocalised;
    lost_now = false;
  } else if (result.state == TrackingState::lost || result.state == TrackingState::tracking) {
    ++lost;
    if (!lost_now) ++losses;
    lost_now = true;
  } else {
    ++before_map;
  }
}

void check_size(const Frame& frame, const CameraModel& camera, const FrameSource& source) {
  if (frame.grey.cols == camera.width() && frame.grey.rows == camera.height()) return;
  throw InputError(source.description() + ": the calibration is for images of " + std::to_string(camera.width()) + "x" +
                   std::to_string(camera.height()) + ", found images of " + std::to_string(frame.grey.cols) + "x" +
                   std::to_string(frame.grey.rows));
}

void keep_result(TrackingResult result, const RunOptions& options, RunResult* out) {
  result.points.clear();
  result.points.shrink_to_fit();
  result.trails.clear();
  result.trails.shrink_to_fit();
  ++out->frames_delivered;
  if (result.camera_from_world) ++out->frames_tracked;
  out->counts.add(result);
  if (options.kept_frames < std::numeric_limits<std::size_t>::max()) {
    if (options.keep_trajectory) keep_pose(result, out);
    append_bounded(std::move(result), options.kept_frames, &out->frames);
  } else {
    out->frames.push_back(std::move(result));
  }
}

MapperOptions with_vocabulary(MapperOptions options) {
  if (options.close_loops && !options.vocabulary) options.vocabulary = place_vocabulary();
  return options;
}

void begin_with(const RunOptions& options, SharedMap* map) {
  if (!options.initial_map) return;
  Map known = options.initial_map->map;
  age_counts(&known);
  map->replace_map(std::move(known));
  map->publish();
}

void collect_warnings(FrameSource* source, RunResult* out) {
  for (SourceWarning& w : source->take_warnings()) append_bounded(std::move(w), kWarningsKept, &out->warnings);
}

void collect_map(const SharedMap& map, const RunOptions& options, RunResult* out) {
  MapCopy copy = map.copy();
  out->map = std::move(copy.map);
  out->world_from_first = copy.world_from_first;
  out->warps = copy.warps;
  out->map_version = copy.map_version;
  if (copy.map_version == kInitialMapVersion) out->initial_map = options.initial_map;
  out->lock_times = map.lock_times();
  out->snapshot_waits_ms = map.snapshot_waits_ms();
}

SessionEngine::SessionEngine(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                             SessionRecorder* recorder)
    : source_(source),
      camera_(camera),
      options_(checked(options, recorder)),
      recorder_(recorder),
      inbox_(kMapperInbox),
      tracker_schedule_(tracker_schedule(&map_, &inbox_, recorder)),
      mapper_schedule_(mapper_schedule(&inbox_, recorder)),
      mapper_(camera, with_vocabulary(options_.mapper), &map_, mapper_schedule_.get()),
      tracker_(camera, options_.tracker, options_.automatic_initialisation(), tracker_schedule_.get()),
      arriving_(kLiveQueue),
      started_(SteadyClock::now()) {
  begin_with(options_, &map_);
  if (recorder_) recorder_->begin(camera_, options_, source_->frames_per_second());
}

SessionEngine::~SessionEngine() { join(); }

void SessionEngine::start(bool paced) {
  started_ = SteadyClock::now();
  mapping_ = std::jthread([this](std::stop_token stop) {
    try {
      mapper_.run(stop);
    } catch (...) {
      fail(std::current_exception());
      inbox_.close();
      arriving_.close();
    }
  });
  reading_ = std::jthread([this, paced](std::stop_token stop) {
    try {
      read_frames(stop, paced);
    } catch (...) {
      fail(std::current_exception());
    }
    source_ended_ = true;
    arriving_.close();
  });
}

// Whether or not the tracker is ready; the newest frame is kept.
void SessionEngine::read_frames(std::stop_token stop, bool paced) {
  std::optional<Timestamp> first;
  const auto start = SteadyClock::now();
  Mutex mutex;
  std::condition_variable_any wake;
  auto memory_due = start + kMemoryInterval;
  while (!stop.stop_requested()) {
    auto frame = source_->next();
    if (!frame) break;
    if (SteadyClock::now() > memory_due) {
      return_freed_memory();
      memory_due = SteadyClock::now() + kMemoryInterval;
    }
    check_size(*frame, camera_, *source_);
    if (paced) {
      if (!first) first = frame->time;
      const std::chrono::duration<double, std::nano> since_first = frame->time - *first;
      const auto due = start + std::chrono::duration_cast<SteadyClock::duration>(since_first / options_.speed);
      MutexLock lock(mutex);
      wake.wait_until(mutex, stop, due, [] { return false; });
    }
    if (stop.stop_requested()) break;
    ++frames_read_;
    if (recorder_) recorder_->add_frame(*frame);
    if (arriving_.push_drop_oldest(std::move(*frame))) ++frames_dropped_;
  }
}

void SessionEngine::fail(std::exception_ptr failure) {
  MutexLock lock(failure_mutex_);
  if (!failure_) failure_ = std::move(failure);
}

std::string SessionEngine::failure() const {
  std::exception_ptr failure;
  {
    MutexLock lock(failure_mutex_);
    failure = failure_;
  }
  if (!failure) return "";
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {
    return "internal error: unknown exception";
  }
}

void SessionEngine::track_all(const std::function<bool(int)>& key_at, const FrameObserver& observer) {
  while (auto frame = arriving_.pop()) {
    const bool key = key_at(frame->index);
    TrackingResult result = tracker_.track(*frame, key);
    if (recorder_) recorder_->frame_tracked(frame->index, key, hash_of(result));
    if (observer) observer(*frame, result, tracker_.map());
    keep_result(std::move(result), options_, &result_);
  }
}

void SessionEngine::stop_tracking() {
  arriving_.close();
  arriving_.clear();
}

void SessionEngine::join() {
  arriving_.close();
  if (reading_.joinable()) {
    reading_.request_stop();  // when the mapper failed, the rest of the recording is not waited for
    reading_.join();
  }
  if (mapping_.joinable()) {
    mapping_.request_stop();
    mapping_.join();
  }
}

RunResult SessionEngine::finish() {
  // The tracker has stopped: no new keyframes come, so the mapper finishes its work within a limit.
  const auto end = SteadyClock::now() +
                   std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(kRealtimeFinish_s));
  join();
  collect_warnings(source_, &result_);
  std::exception_ptr failure;
  {
    MutexLock lock(failure_mutex_);
    failure = failure_;
  }
  if (failure) std::rethrow_exception(failure);
  while (SteadyClock::now() < end && mapper_.step()) {
  }
  inbox_.close();
  result_.frames_read = frames_read_;
  result_.frames_dropped = frames_dropped_;
  result_.mapper = mapper_.statistics();
  result_.wall_seconds = milliseconds_since(started_) * 1e-3;
  collect_map(map_, options_, &result_);
  if (recorder_) recorder_->finish(hash_of(result_.map));
  return std::move(result_);
}

}  // namespace parallax
