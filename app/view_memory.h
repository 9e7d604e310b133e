// What a view remembers from one frame to the next: the last refusal, which the tracker says once, and where tracking
// was lost. A value type of the thread that draws.
#pragma once

#include <optional>
#include <string>

#include "map/tracking_snapshot.h"
#include "tracker/tracking_types.h"

namespace parallax {

class ViewMemory {
 public:
  // Every drawn frame, in order.
  void update(const TrackingResult& tracked);

  // The last thing the tracker had to say, for some seconds of the frames' time; empty afterwards, and once tracking
  // goes on.
  const std::string& message() const { return message_; }
  // Where the camera was when it was last tracked, in the world of the snapshot; nothing when that was on another map.
  std::optional<RigidTransform> last_pose(const TrackingSnapshot& map) const;

  // How long a message stays.
  static constexpr double kMessage_s = 6;

 private:
  std::string message_;
  Timestamp message_time_{0};
  std::optional<RigidTransform> pose_;
  std::uint64_t map_version_ = 0;
  WorldStamp world_;
  KeyframeId seen_from_;
};

// The keyframe from which the view is most like the one from this pose: near it, in units of the depth of its scene,
// and looking the same way. Null when there is none.
const SnapshotKeyframe* nearest_keyframe(const TrackingSnapshot& map, const RigidTransform& camera_from_world);

// A small picture of it (half size), shared with the map; empty when it has no images.
GreyImage keyframe_picture(const SnapshotKeyframe& keyframe);

}  // namespace parallax
