// New map points in a keyframe (PTAM §6.2): salient points, epipolar search in other keyframes, insertion.
#pragma once

#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// Searches the given keyframe's salient points in its nearest keyframes (the closest first; a point not found there is
// tried in the next). Returns how many points were added.
int create_points(SharedMap* map, const CameraModel& camera, const MapperOptions& options, KeyframeId keyframe);

}  // namespace parallax
