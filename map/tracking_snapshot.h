// What the tracker reads of the map every frame, laid out for it: an immutable structure of arrays, published by the
// mapper after each commit and swapped in by one pointer, so that the tracker never waits for the map.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/se3.h"
#include "map/map.h"
#include "map/world_warp.h"

namespace parallax {

struct SnapshotKeyframe {
  KeyframeId id;
  RigidTransform camera_from_world;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::shared_ptr<const FrameImages> images;
  double mean_depth = 1;
};

struct TrackingSnapshot {
  std::uint64_t version = 0;  // grows with every publication
  // Changes of the world frame so far, the product of those that moved it as one, and those that closed a loop: the
  // tracker takes its pose from the world it knew to the present one by newest.world().rebase(known.stamp(), ...).
  std::uint64_t world_version = 0;
  SimilarityTransform world_from_first;
  WorldWarps warps;
  std::uint64_t map_version = 0;  // grows when the map is reset or initialised anew: nothing carries over

  std::vector<SnapshotKeyframe> keyframes;  // in order of age

  // Per point, in order of age. Row i of each array is one point.
  std::vector<PointId> id;
  std::vector<float> x, y, z;                    // world, for the vectorised cull
  std::vector<float> nx, ny, nz;                 // normal
  std::vector<Eigen::Vector3d> position;         // world, full precision
  std::vector<Eigen::Matrix<float, 3, 2>> axes;  // patch_axes(): zero where the patch is edge-on
  std::vector<std::int32_t> source;              // row of `keyframes`
  std::vector<std::uint8_t> source_level;
  std::vector<Eigen::Vector2f> source_pixel;  // pixels of source_level
  std::vector<std::uint8_t> quality;          // observers, saturating at 255: better-known points are preferred

  std::optional<Plane> plane;  // the dominant one
  std::vector<Plane> planes;   // all of them, the dominant one included

  WorldState world() const { return {world_from_first, warps}; }
  WorldStamp stamp() const { return {world_from_first, warps.size()}; }
  int size() const { return static_cast<int>(id.size()); }
  bool empty() const { return keyframes.empty(); }
};

std::shared_ptr<const TrackingSnapshot> make_snapshot(const Map& map);

}  // namespace parallax
