// What passes from the tracking thread to the mapping thread, and back through futures. The queue is bounded; a
// keyframe that is refused stays with the tracker, which may offer a later one.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "core/bounded_queue.h"
#include "core/mutex.h"
#include "core/se3.h"
#include "core/time.h"
#include "map/entities.h"
#include "map/map.h"
#include "map/world_warp.h"

namespace parallax {

// A frame that the tracker thinks worth keeping (PTAM §6.2).
struct KeyframeProposal {
  int frame = -1;
  Timestamp time{0};
  RigidTransform camera_from_world;
  std::uint64_t world_version = 0, map_version = 0;  // of the snapshot it was tracked with
  WorldStamp world;
  std::shared_ptr<const FrameImages> images;
  std::vector<Measurement> measurements;
};

// How the tracker fared with each point since it last reported.
struct PointCount {
  PointId point;
  std::uint16_t searched = 0, found = 0, outliers = 0;
};
struct PointCounts {
  std::uint64_t map_version = 0;
  std::vector<PointCount> counts;
};

// Two views and their 2D tracks (PTAM §6.1).
struct TrailMatch {
  int trail = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero(), second = Eigen::Vector2d::Zero();  // level-0 pixels
};
struct InitialisationReply {
  bool ok = false;
  std::string reason;  // one sentence for the user when refused
  RigidTransform second_from_world;
  std::vector<std::pair<int, PointId>> point_of_trail;
};
struct InitialisationRequest {
  bool automatic = false;  // chosen by measured parallax: held to stricter terms than a key press
  int first_frame = -1, second_frame = -1;
  Timestamp first_time{0}, second_time{0};
  std::shared_ptr<const FrameImages> first, second;
  std::vector<TrailMatch> matches;
  std::promise<InitialisationReply> reply;
};

// Everything is forgotten; answered when the map is empty.
struct ResetRequest {
  std::promise<void> done;
};

// Changes of the map that the user asks for.
struct MapEditReply {
  bool ok = false;
  std::string reason;  // one sentence for the user when refused
};
// The world is multiplied by the factor about its origin; everything on it follows without a jump.
struct ScaleRequest {
  double factor = 1;
  std::promise<MapEditReply> reply;
};
// The dominant plane is looked for again; with a seed point (world), the plane around it joins the map's planes and
// becomes the dominant one. Planes are in the world as it is: nothing else moves.
struct PlaneRequest {
  std::optional<Eigen::Vector3d> seed;
  std::promise<MapEditReply> reply;
};

// Another map, which was stored, takes the place of the present one; the tracker finds itself on it. Refused when the
// present map is no longer that of `instead_of` (TrackingSnapshot::map_version): somebody else was quicker.
struct LoadMapReply {
  bool ok = false;
  std::string reason;             // one sentence for the user when refused
  std::uint64_t map_version = 0;  // of the map that was loaded
};
struct LoadMapRequest {
  Map map;
  bool adapt = true;  // false: the map stays as it is, whatever the tracker sees (a locked map)
  std::uint64_t instead_of = 0;
  std::promise<LoadMapReply> reply;
};

// A map that was merged from a copy of the present one and another takes the present one's place; the tracker and
// whatever stands on the map go on as after a closed loop. What has come to the present map since it was copied is
// taken along. Refused when that is not possible: another map, a moved world, or too much that has changed.
struct MergeMapReply {
  bool ok = false;
  std::string reason;  // one sentence when refused
  // The world as the merged map has it, which is re-scaled when only the other map's scale was known.
  std::uint64_t world_version = 0;
  WorldState world;
  std::int32_t keyframe_shift = 0;  // keyframes of the other map have identifiers larger by this than in `merged`
};
struct MergeMapRequest {
  std::shared_ptr<const Map> base;                   // the copy of the present map
  Map merged;                                        // identifiers of `base` kept; the other map's follow them
  std::uint64_t map_version = 0, world_version = 0;  // of the copy
  std::promise<MergeMapReply> reply;
};

// From now on the present map stays as it is, or adapts again.
struct AdaptRequest {
  bool adapt = true;
};

using MapperMessage = std::variant<KeyframeProposal, PointCounts, InitialisationRequest, ResetRequest, ScaleRequest,
                                   PlaneRequest, LoadMapRequest, MergeMapRequest, AdaptRequest>;

// The mapper's queue. A message that cannot wait (anything but counts) interrupts the solve in progress. Safe from any
// thread.
class MapperInbox {
 public:
  explicit MapperInbox(std::size_t capacity) : queue_(capacity) {}

  // Never waits: false, and the message stays with the caller, when the queue is full.
  bool try_push(MapperMessage& message) PARALLAX_EXCLUDES(mutex_) {
    const bool urgent = !std::holds_alternative<PointCounts>(message);
    if (urgent) {
      MutexLock lock(mutex_);
      ++urgent_waiting_;
    }
    const bool pushed = queue_.try_push(message);
    if (urgent) {
      MutexLock lock(mutex_);
      if (pushed) {
        interrupt_.request_stop();
      } else {
        --urgent_waiting_;
      }
    }
    return pushed;
  }

  std::optional<MapperMessage> try_pop() PARALLAX_EXCLUDES(mutex_) { return counted(queue_.try_pop()); }
  // Waits; nothing when stopped or closed.
  std::optional<MapperMessage> pop(std::stop_token stop) PARALLAX_EXCLUDES(mutex_) { return counted(queue_.pop(stop)); }

  // A token for a long solve: asked to stop as soon as an urgent message waits, at once if one does already.
  std::stop_token interrupt_token() PARALLAX_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    interrupt_ = std::stop_source();
    if (urgent_waiting_ > 0) interrupt_.request_stop();
    return interrupt_.get_token();
  }
  // Stops the solve in progress, whatever it is (quit).
  void interrupt() PARALLAX_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    interrupt_.request_stop();
  }
  // For a message that has to arrive (the user's): waits for room, which the interruption of the solve in progress soon
  // makes. False when closed or stopped.
  bool push(MapperMessage message, std::stop_token stop = {}) PARALLAX_EXCLUDES(mutex_) {
    {
      MutexLock lock(mutex_);
      ++urgent_waiting_;
      interrupt_.request_stop();
    }
    if (queue_.push(std::move(message), stop)) return true;
    MutexLock lock(mutex_);
    --urgent_waiting_;
    return false;
  }
  std::size_t size() const { return queue_.size(); }
  void close() { queue_.close(); }
  bool closed() const { return queue_.closed(); }

 private:
  std::optional<MapperMessage> counted(std::optional<MapperMessage> message) PARALLAX_EXCLUDES(mutex_) {
    if (message && !std::holds_alternative<PointCounts>(*message)) {
      MutexLock lock(mutex_);
      --urgent_waiting_;
    }
    return message;
  }

  BoundedQueue<MapperMessage> queue_;
  Mutex mutex_;
  std::stop_source interrupt_ PARALLAX_GUARDED_BY(mutex_);
  int urgent_waiting_ PARALLAX_GUARDED_BY(mutex_) = 0;
};

}  // namespace parallax
