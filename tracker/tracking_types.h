// What the tracker says about a frame.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/se3.h"
#include "core/time.h"
#include "map/world_warp.h"

namespace parallax {

enum class TrackingState { waiting, trailing, initialising, tracking, lost };
const char* to_string(TrackingState state);

// PTAM §5.6. `poor` is tracked, but gives no keyframes.
enum class TrackingQuality { lost, poor, good };
const char* to_string(TrackingQuality quality);

// A point that was looked for, for drawing.
struct TrackedPoint {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  // level 0: where found, else where predicted
  std::int8_t level = 0;
  bool found = false;
};

// Milliseconds of wall clock each stage took, and of the thread's own processor time in all.
struct TrackingTimes {
  float features = 0;    // pyramid, corners, small image (Table 1: keyframe preparation)
  float projection = 0;  // Table 1: feature projection
  float search = 0;      // Table 1: patch search
  float pose = 0;        // Table 1: iterative pose update
  float recovery = 0;    // trails before there is a map, relocalisation when lost
  float total = 0, cpu = 0;
};

struct TrackingResult {
  int frame = -1;
  Timestamp time{0};
  TrackingState state = TrackingState::waiting;
  TrackingQuality quality = TrackingQuality::lost;
  std::optional<RigidTransform> camera_from_world;  // only when tracked
  // The map the pose refers to, and how its world has moved since the first: poses of different frames are put into one
  // world with it.
  std::uint64_t map_version = 0;
  SimilarityTransform world_from_first;
  std::size_t warps = 0;  // loops closed until then (map/world_warp.h)
  KeyframeId seen_from;   // the keyframe whose points most of those found are; stays while tracking is poor or lost
  WorldStamp stamp() const { return {world_from_first, warps}; }
  std::array<int, kPyramidLevels> attempted{}, found{};
  double sigma = 0;           // robust scale of the normalised residuals
  bool coarse_stage = false;  // the coarse stage was run
  bool relocalised = false;   // came back from lost in this frame
  bool keyframe_proposed = false;
  int map_points = 0, map_keyframes = 0;
  std::string message;  // for the user: a refusal, a hint; empty: nothing to say
  std::vector<TrackedPoint> points;
  std::vector<std::array<Eigen::Vector2f, 2>> trails;  // first, current: before there is a map
  TrackingTimes times;

  int total_attempted() const { return attempted[0] + attempted[1] + attempted[2] + attempted[3]; }
  int total_found() const { return found[0] + found[1] + found[2] + found[3]; }
};

}  // namespace parallax
