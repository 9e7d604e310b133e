// Measures points again where they are measured already: what was measured with the wrong warp is a little off (a
// template drawn at the wrong slant matches best a little beside the point).
#pragma once

#include <vector>

#include "core/camera_model.h"
#include "core/interruption.h"
#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// Every measurement of the points, outside their source, is aligned again from its present place with the point's
// present normal and source. One that cannot be is left as it is. Extracts and commits a block of points at a time;
// stops early when asked. Returns how many measurements moved; the caller adjusts and publishes.
int remeasure_points(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                     const std::vector<PointId>& points, const Interruption& stop);

}  // namespace parallax
