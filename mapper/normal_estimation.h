// Patch normals estimated online (where PTAM §6.5 and §8.2 say it is weak): candidates for a point's normal come from its neighbours
// in space; the one whose warped patch agrees best with what other keyframes show wins.
#pragma once

#include <stop_token>

#include "core/camera_model.h"
#include "map/shared_map.h"

namespace parallax {

// Looks at points that have enough observers and no estimated normal yet; stops early when asked. Returns how many
// normals were changed. The caller publishes.
int estimate_normals(SharedMap* map, const CameraModel& camera, std::stop_token stop);

}  // namespace parallax
