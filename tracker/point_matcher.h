// Matches the map's points with a frame's corners by descriptor, without any prior: what recovery falls back on when the small
// blurry images do not lead to a pose.
#pragma once

#include <array>
#include <unordered_map>
#include <vector>

#include "core/binary_descriptor.h"
#include "map/tracking_snapshot.h"
#include "solver/pose_refinement.h"

namespace parallax {

// Keeps the descriptors of the map's points, made a few keyframes at a time, only while the camera is lost. Not thread-safe; belongs to
// the tracking thread.
class PointMatcher {
 public:
  // Describes the points of at most `max_keyframes` source keyframes that have none yet. False when nothing was left.
  bool prepare(const TrackingSnapshot& map, int max_keyframes);

  // One-to-one matches of described points with the frame's corners: nearest descriptor, clearly nearer than the second.
  std::vector<PoseObservation> match(const TrackingSnapshot& map, const FrameImages& frame) const;

  void clear() { described_.clear(); }

 private:
  struct Described {
    KeyframeId source;
    Eigen::Vector2f source_pixel = Eigen::Vector2f::Zero();
    BinaryDescriptor descriptor;
    bool ok = false;
  };
  std::unordered_map<std::int32_t, Described> described_;  // by point index
};

}  // namespace parallax
