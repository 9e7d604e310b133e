// Makes the first map from two views and their 2D tracks (PTAM §6.1).
#pragma once

#include <random>

#include "map/messages.h"
#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// Solves for the two poses, triangulates, adjusts, adds points on all levels by epipolar search, scales to the initial
// baseline and lays the dominant plane at z = 0. When it refuses, the map is left as it was and the reply says why.
// On success any earlier map is replaced. The caller publishes.
InitialisationReply initialise_map(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                                   const InitialisationRequest& request, std::mt19937_64* rng);

}  // namespace parallax
