// Bundle adjustment of the shared map (PTAM §6.3): extract under the lock, solve outside it, commit under it. Local:
// Eq. 11, global: Eq. 10.
#pragma once

#include <utility>
#include <vector>

#include "core/interruption.h"
#include "map/shared_map.h"
#include "mapper/mapper_options.h"
#include "solver/bundle_adjustment.h"

namespace parallax {

struct AdjustmentReport {
  bool ran = false;  // there was something to adjust
  BundleSummary solve;
  int poses = 0, points = 0, observations = 0;
  std::vector<std::pair<KeyframeId, PointId>> outliers;  // measurements taken out: candidates for a second chance
  std::vector<KeyframeId> suspicious;                    // keyframes most of whose measurements were outliers
  int points_erased = 0;
  double milliseconds = 0;
};

// The keyframe and its nearest neighbours move, with all points they see; every other keyframe that measures one of the
// points is held fixed.
AdjustmentReport adjust_local(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                              KeyframeId newest, const Interruption& stop);

// All keyframes but the fixed first, and all points.
AdjustmentReport adjust_global(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                               const Interruption& stop);

}  // namespace parallax
