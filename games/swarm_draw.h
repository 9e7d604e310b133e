// A picture of a game of Swarm: models with moving legs, bolts, sparks, health bars and the reticle.
#pragma once

#include "games/playing_field.h"
#include "games/swarm_poses.h"
#include "games/swarm_simulation.h"
#include "render/draw_list.h"
#include "render/model_set.h"

namespace parallax::swarm {

// Appends to the list; world frame. `poses` keeps what was made for pictures before; it goes with the models. Things
// are as fine as the list's camera sees them.
void draw_swarm(const Simulation& simulation, const PlayingField& field, const ModelSet& models, CritterPoses* poses,
                DrawList* out);

// Of a kind of critter, or of what is not a critter: told apart by people with any colour vision in the safe palette
// (Okabe and Ito 2008).
DrawColour colour_of(CritterKind kind, bool colour_blind_safe);
DrawColour health_colour(double part, bool colour_blind_safe);

}  // namespace parallax::swarm
