// Gives the answers of a recorded session again, on one thread: before a frame the mapper's steps are run until the
// version of the map that the frame saw is there; versions are kept until no frame can ask for them.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>

#include "core/error.h"
#include "map/schedule_log.h"

namespace parallax {

// The replay does not do what the recording did: one line.
class ReplayDifference : public RunError {
 public:
  using RunError::RunError;
};

// Not thread-safe. Tracker and Mapper are made with tracker() and mapper().
class ReplaySchedule {
 public:
  // `map` outlives it and is listened to.
  ReplaySchedule(ScheduleLog log, SharedMap* map);
  ~ReplaySchedule();
  ReplaySchedule(const ReplaySchedule&) = delete;
  ReplaySchedule& operator=(const ReplaySchedule&) = delete;

  TrackerSchedule* tracker();
  MapperSchedule* mapper();
  // Mapper::step of the mapper made with mapper(); set before the first frame.
  void set_mapper_step(std::function<bool()> step) { mapper_step_ = std::move(step); }

  // The entry of the frame when it was tracked, with the map made ready for it; null when it was not. `ended` is set
  // when the log ends before the frame could be replayed. Throws ReplayDifference.
  const FrameEntry* begin_frame(int frame, bool* ended);
  // After Tracker::track: everything that was noted must have been asked for. Throws ReplayDifference.
  void end_frame();
  // Runs the steps that are left. Throws ReplayDifference.
  void finish();

  // No frame after the last that was begun.
  bool at_end() const { return next_frame_ >= log_.frames.size(); }
  const ScheduleLog& log() const { return log_; }

 private:
  class Tracking;
  class Mapping;

  bool run_step();  // false when there is none left
  [[noreturn]] void differs(const std::string& how) const;

  ScheduleLog log_;
  SharedMap* map_;
  std::function<bool()> mapper_step_;
  std::map<std::uint64_t, std::shared_ptr<const TrackingSnapshot>> published_;
  std::deque<MapperMessage> sent_;  // by the tracker, not yet taken
  std::size_t next_frame_ = 0, next_step_ = 0;
  const FrameEntry* frame_ = nullptr;
  std::size_t pushes_ = 0, questions_ = 0;
  bool step_taken_ = false;  // the present step's entry was used
  std::unique_ptr<Tracking> tracking_;
  std::unique_ptr<Mapping> mapping_;
};

}  // namespace parallax
