// A merged map takes the place of the present one while the session goes on. Merging took a while, and was done on a
// copy of the present map: what has come to it since is carried over to the merged map, what has gone from it goes
// there too, and how its world has moved is known for every keyframe, so that the tracker and what stands on the map
// follow as after a closed loop (map/world_warp).
//
// Plain functions on plain values, safe from any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/camera_model.h"
#include "map/map.h"
#include "map/world_warp.h"

namespace parallax {

struct MergeCommit {
  std::string reason;  // when it is refused: one sentence, and the map is empty
  // Identifiers of the present map are kept. Those of the other map follow them, larger than in the merged map by the
  // shift.
  Map map;
  std::shared_ptr<const WorldWarp> warp;  // a node a keyframe of the present map
  std::int32_t keyframe_shift = 0, point_shift = 0;
  KeyframeId newest;                                      // the newest of the present map that is left
  int keyframes_taken_along = 0, points_taken_along = 0;  // that have come meanwhile
};

// `base` is what `present` was when the maps were merged, in the same world; `merged` is merge_maps(base, other).
// `world_from_first` is that of the present map's world. Refused when less than half of the present keyframes are in
// the merged map, or when what comes of it is not consistent.
MergeCommit rebase_merged(const Map& present, const SimilarityTransform& world_from_first, const CameraModel& camera,
                          const Map& base, const Map& merged);

}  // namespace parallax
