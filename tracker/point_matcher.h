// Matches the map's points with a frame's corners by descriptor, without any prior: what recovery falls back on when
// the small blurry images do not lead to a pose.
#pragma once

#include <array>
#include <unordered_map>
#include <vector>

#include "core/binary_descriptor.h"
#include "map/tracking_snapshot.h"
#include "solver/pose_refinement.h"

namespace parallax {

// Keeps the descriptors of the map's points, made a few keyframes at a time, only while the camera is lost. Not
// thread-safe; belongs to the tracking thread.
class PointMatcher {
 public:
  // Describes the points of at most `max_keyframes` source keyframes that have none yet, or whose source has changed.
  // False when nothing was left. A map that was made anew (map_version) starts from nothing.
  bool prepare(const TrackingSnapshot& map, int max_keyframes);

  // One-to-one matches of described points with the frame's corners: nearest descriptor, clearly nearer than that of
  // any point of another place; best first. The standard deviation is one pixel of the corner's level. `turns`, when
  // given, receives by what angle each has turned in the image since it was described (radians, x towards y).
  std::vector<PoseObservation> match(const TrackingSnapshot& map, const FrameImages& frame,
                                     std::vector<double>* turns = nullptr) const;

  void clear() { described_.clear(); }

 private:
  struct Described {
    KeyframeId source;
    int source_level = 0;
    Eigen::Vector2f source_pixel = Eigen::Vector2f::Zero();
    BinaryDescriptor descriptor;
    std::uint8_t orientation = 0;
    bool ok = false;
  };
  bool is_current(const Described& entry, const TrackingSnapshot& map, int row) const;

  std::unordered_map<std::int32_t, Described> described_;  // by point index
  std::uint64_t map_version_ = 0;
};

}  // namespace parallax
