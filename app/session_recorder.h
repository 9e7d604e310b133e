// Records a live session: raw frames as they came, the schedule of the two threads, keys and edits, the settings and
// the calibration. Compression and writing happen on a thread of their own behind a bounded queue; nobody waits for
// the disk. When the disk is full the recording ends with one line, and the session goes on.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <thread>

#include "app/run_session.h"
#include "camera/recording_file.h"
#include "map/schedule_log.h"

namespace parallax {

// What the session knows of its camera.
struct RecordingDescription {
  std::string source;      // as on the command line
  RecordingHeader camera;  // settings of the camera: name and value
  std::string map;         // the bytes of the map file that the session begins with; empty: none
  std::size_t queue = 90;  // frames that wait for compression at most: 3 s of 640x480 in colour are 110 MB
};

class SessionRecorder {
 public:
  // Creates the file. Throws RunError when it cannot be written.
  SessionRecorder(const std::string& path, const RecordingDescription& description);
  ~SessionRecorder();  // what was handed in is written; without finish() the recording has no end, as after a kill
  SessionRecorder(const SessionRecorder&) = delete;
  SessionRecorder& operator=(const SessionRecorder&) = delete;

  // Before the threads of the session start, once: writes the header and starts the recorder's thread. Throws RunError.
  void begin(const CameraModel& camera, const RunOptions& options, double frames_per_second);
  // Noting schedules for tracker and mapper; the recorder outlives them.
  std::unique_ptr<TrackerSchedule> tracker_schedule(const SharedMap* map, MapperInbox* inbox);
  std::unique_ptr<MapperSchedule> mapper_schedule(MapperInbox* inbox);

  // Camera thread: a frame that was read. Dropped, and counted, when the queue is full. The images are shared, not
  // copied.
  void add_frame(const Frame& frame);
  // Tracking thread: the frame was tracked, with the key pressed or not, and came to this.
  void frame_tracked(int frame, bool key, std::uint64_t result_hash);
  // After all threads have ended: everything is written, the hash of the last map with it.
  void finish(std::uint64_t map_hash);

  // From any thread.
  int frames_dropped() const;
  bool recording() const;      // false once writing has failed, and after finish()
  std::string take_failure();  // one line, once; empty: all is well
  const std::string& path() const { return path_; }

 private:
  void add_entry(const ScheduleEntry& entry);
  void run();
  bool write_some(std::optional<Frame> frame, const std::string& entries);
  void end_thread();

  const std::string path_;
  const RecordingDescription description_;
  RecordingWriter writer_;  // the recorder's thread, once it runs
  RecordingTrackerSchedule* tracking_ = nullptr;

  mutable Mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<Frame> frames_ PARALLAX_GUARDED_BY(mutex_);
  std::string entries_ PARALLAX_GUARDED_BY(mutex_);
  int dropped_ PARALLAX_GUARDED_BY(mutex_) = 0, written_ PARALLAX_GUARDED_BY(mutex_) = 0;
  bool failed_ PARALLAX_GUARDED_BY(mutex_) = false, ended_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::string failure_ PARALLAX_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace parallax
