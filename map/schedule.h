// What the two threads learn from each other, and when: everything of a session that depends on how fast its threads
// ran passes through these two interfaces. Live they ask the map and the inbox; a recording notes every answer; a
// replay gives the noted answers again on one thread, so that tracker and mapper compute the same bits
// (map/schedule_log, map/replay_schedule).
#pragma once

#include <future>
#include <memory>
#include <optional>
#include <stop_token>

#include "core/interruption.h"
#include "map/messages.h"
#include "map/shared_map.h"

namespace parallax {

// Belongs to the tracking thread.
class TrackerSchedule {
 public:
  virtual ~TrackerSchedule() = default;

  // The map that the frame sees; asked once a frame.
  virtual std::shared_ptr<const TrackingSnapshot> snapshot() = 0;
  // Never waits: false, and the message stays with the caller, when the mapper has no room.
  virtual bool try_push(MapperMessage& message) = 0;
  // Whether the mapper has answered.
  virtual bool is_ready(const std::future<InitialisationReply>& reply) = 0;
};

// Belongs to the mapping thread, but for interrupt().
class MapperSchedule {
 public:
  virtual ~MapperSchedule() = default;

  virtual std::optional<MapperMessage> try_pop() = 0;
  // Waits; nothing when stopped or closed.
  virtual std::optional<MapperMessage> pop(std::stop_token stop) = 0;
  // What may end the unit of work that begins now; handed to worked() when it is done.
  virtual Interruption interruption() = 0;
  virtual void worked(const Interruption& interruption) = 0;
  // Stops the work in progress (quit). From any thread.
  virtual void interrupt() = 0;
};

// The answers as they come.
class LiveTrackerSchedule : public TrackerSchedule {
 public:
  // Both outlive it.
  LiveTrackerSchedule(const SharedMap* map, MapperInbox* inbox) : map_(map), inbox_(inbox) {}

  std::shared_ptr<const TrackingSnapshot> snapshot() override { return map_->snapshot(); }
  bool try_push(MapperMessage& message) override { return inbox_->try_push(message); }
  bool is_ready(const std::future<InitialisationReply>& reply) override {
    return reply.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }

 private:
  const SharedMap* map_;
  MapperInbox* inbox_;
};

class LiveMapperSchedule : public MapperSchedule {
 public:
  explicit LiveMapperSchedule(MapperInbox* inbox) : inbox_(inbox) {}

  std::optional<MapperMessage> try_pop() override { return inbox_->try_pop(); }
  std::optional<MapperMessage> pop(std::stop_token stop) override { return inbox_->pop(stop); }
  Interruption interruption() override { return Interruption(inbox_->interrupt_token()); }
  void worked(const Interruption&) override {}
  void interrupt() override { inbox_->interrupt(); }

 private:
  MapperInbox* inbox_;
};

}  // namespace parallax
