// The threads of a session on one map: the camera's, which keeps the newest frames for the tracker, and the mapper's.
// Tracking runs on the thread that calls track_all(). `parallax run` at realtime pace and the live session are built on
// it.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>

#include "app/run_session.h"
#include "core/bounded_queue.h"
#include "map/schedule.h"

namespace parallax {

class SessionRecorder;

class SessionEngine {
 public:
  // Everything handed in outlives the engine; `recorder` may be null.
  SessionEngine(FrameSource* source, const CameraModel& camera, const RunOptions& options, SessionRecorder* recorder);
  ~SessionEngine();
  SessionEngine(const SessionEngine&) = delete;
  SessionEngine& operator=(const SessionEngine&) = delete;

  // Starts the camera's and the mapper's thread. Paced: frames arrive at their time stamps (over the speed); else as
  // the source delivers them.
  void start(bool paced);
  // Tracks until the source ends, stop_tracking() is called or a thread has failed. `key_at`: whether the
  // initialisation key is pressed at the frame.
  void track_all(const std::function<bool(int)>& key_at, const FrameObserver& observer);
  // From any thread: no further frame is tracked. A source that waits for its camera is woken by its owner.
  void stop_tracking();

  // Ends both threads, lets the mapper finish its work for at most a few seconds, fills in what is known only then and
  // throws what a thread failed of. After track_all() has returned; once.
  RunResult finish();

  // From any thread.
  SharedMap& map() { return map_; }
  MapperInbox& inbox() { return inbox_; }
  int frames_read() const { return frames_read_.load(); }
  int frames_dropped() const { return frames_dropped_.load(); }
  bool source_ended() const { return source_ended_.load(); }
  // One line, when the camera's or the mapper's thread has failed: empty otherwise.
  std::string failure() const;

 private:
  void read_frames(std::stop_token stop, bool paced);
  void fail(std::exception_ptr failure);
  void join();

  FrameSource* source_;
  CameraModel camera_;
  RunOptions options_;
  SessionRecorder* recorder_;
  SharedMap map_;
  MapperInbox inbox_;
  std::unique_ptr<TrackerSchedule> tracker_schedule_;
  std::unique_ptr<MapperSchedule> mapper_schedule_;
  Mapper mapper_;
  Tracker tracker_;
  BoundedQueue<Frame> arriving_;
  RunResult result_;
  SteadyClock::time_point started_;

  std::atomic<int> frames_read_{0}, frames_dropped_{0};
  std::atomic<bool> source_ended_{false};
  mutable Mutex failure_mutex_;
  std::exception_ptr failure_ PARALLAX_GUARDED_BY(failure_mutex_);
  std::jthread mapping_, reading_;
};

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

// Throws InputError when the frame is not of the camera's size.
void check_size(const Frame& frame, const CameraModel& camera, const FrameSource& source);

// The program's visual words for what needs them, unless they are there already. Throws InputError when the file is
// not.
MapperOptions with_vocabulary(MapperOptions options);

// Puts the map that the options begin with in its place; before anything runs.
void begin_with(const RunOptions& options, SharedMap* map);

// Keeps a frame's result as RunOptions asks for, and moves what the source complained of.
void keep_result(TrackingResult result, const RunOptions& options, RunResult* out);
void collect_warnings(FrameSource* source, RunResult* out);
// The map and its versions as they are now, into the result.
void collect_map(const SharedMap& map, const RunOptions& options, RunResult* out);

}  // namespace parallax
