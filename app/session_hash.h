// What a session came to, in a number: equal when every bit is.
#pragma once

#include <cstdint>

#include "map/map.h"
#include "tracker/tracking_types.h"

namespace parallax {

// State, pose, map version and counts of a frame; no times.
std::uint64_t hash_of(const TrackingResult& result);
// Poses, points, measurements and planes; images by the frames they are of.
std::uint64_t hash_of(const Map& map);

}  // namespace parallax
