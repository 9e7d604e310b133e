// A patient player of Swarm, for demonstrations and tests. It does not move the camera: it drives the robot so that
// critters come under the cross-hairs without coming close, and fires when one is in the way of a bolt.
#pragma once

#include "games/game.h"
#include "games/swarm_ground.h"
#include "games/swarm_state.h"

namespace parallax::swarm {

GameInput play_patiently(const State& state, const Ground& ground,
                         const std::optional<RigidTransform>& camera_from_plane);

}  // namespace parallax::swarm
