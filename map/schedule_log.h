// What a session's two threads learnt from each other, written down: a frame's entry from the tracking thread, an entry
// for each message and each unit of work from the mapping thread. Bytes and back; knows no file.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "map/schedule.h"

namespace parallax {

// One tracked frame.
struct FrameEntry {
  int frame = -1;
  bool key = false;                   // the initialisation key was pressed
  std::uint64_t snapshot = 0;         // version of the map it saw
  std::vector<std::uint8_t> pushed;   // for each message to the mapper: whether there was room
  std::vector<std::uint8_t> replied;  // for each question: whether the mapper had answered
  std::uint64_t result_hash = 0;      // of what came of it
};

// One step of the mapper.
struct StepEntry {
  enum class Kind : std::uint8_t { message, work, reset, scale, plane };
  Kind kind = Kind::work;
  std::int64_t stopped_at = 0;          // work: the question that was answered with "stop"; 0: none
  double factor = 1;                    // scale
  std::optional<Eigen::Vector3d> seed;  // plane
  bool operator==(const StepEntry&) const = default;
};

using ScheduleEntry = std::variant<FrameEntry, StepEntry>;

struct ScheduleLog {
  std::vector<FrameEntry> frames;  // in order
  std::vector<StepEntry> steps;    // in order
};

// Appends the entry's bytes.
void write_entry(const ScheduleEntry& entry, std::string* bytes);
// Throws InputError ("NAME: schedule, byte N: found X, expected Y") for anything that write_entry does not make.
ScheduleLog parse_schedule(std::span<const std::uint8_t> bytes, const std::string& name);

// A live session's answers, noted. The sink is called on the thread the schedule belongs to.
class RecordingTrackerSchedule final : public LiveTrackerSchedule {
 public:
  using LiveTrackerSchedule::LiveTrackerSchedule;

  std::shared_ptr<const TrackingSnapshot> snapshot() override;
  bool try_push(MapperMessage& message) override;
  bool is_ready(const std::future<InitialisationReply>& reply) override;

  // What was noted since the last call; frame, key and hash are filled in by the caller.
  FrameEntry take_entry() { return std::exchange(entry_, {}); }

 private:
  FrameEntry entry_;
};

class RecordingMapperSchedule final : public LiveMapperSchedule {
 public:
  RecordingMapperSchedule(MapperInbox* inbox, std::function<void(const StepEntry&)> sink)
      : LiveMapperSchedule(inbox), sink_(std::move(sink)) {}

  std::optional<MapperMessage> try_pop() override { return noted(LiveMapperSchedule::try_pop()); }
  std::optional<MapperMessage> pop(std::stop_token stop) override { return noted(LiveMapperSchedule::pop(stop)); }
  void worked(const Interruption& interruption) override;

 private:
  std::optional<MapperMessage> noted(std::optional<MapperMessage> message);
  std::function<void(const StepEntry&)> sink_;
};

}  // namespace parallax
