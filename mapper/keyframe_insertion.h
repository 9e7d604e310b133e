// A new keyframe enters the map (PTAM §6.2): the tracker's pose and measurements, then the remaining map points
// measured in it.
#pragma once

#include <optional>

#include "map/messages.h"
#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// Nothing when the proposal belongs to a map that is gone, or measures too little. New points are not made here.
std::optional<KeyframeId> insert_keyframe(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                                          const KeyframeProposal& proposal);

}  // namespace parallax
