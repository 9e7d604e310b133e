// How critters think and move, each kind in its own way:
//   swarmer  straight for the robot, in a flock: keeps apart from all, together with its own kind
//   flanker  round the robot, out of its line of fire, and then at it from behind
//   jumper   walks up, crouches, and leaps onto the robot; bolts pass under it
//   spitter  keeps its distance, strafes and spits where the robot is
// Real things are walked around. Pure rules on the state; one tick a call.
#pragma once

#include <vector>

#include "games/swarm_ground.h"
#include "games/swarm_neighbours.h"
#include "games/swarm_state.h"

namespace parallax::swarm {

// What critters do to the rest of the world in a tick.
struct CritterDeed {
  enum class Kind { bite, leap_off, land_on, spit } kind = Kind::bite;
  std::size_t critter = 0;
};

// Moves every critter by a tick; deeds are appended in the critters' order. Spits are added to the state. The ground's
// goal is the robot.
void move_critters(const Ground& ground, const Neighbours& neighbours, State* state, std::vector<CritterDeed>* deeds);

// A critter of that kind that begins to climb in at an entry.
Critter climbing_critter(CritterKind kind, const Ground::Entry& entry, int wave, int side);

}  // namespace parallax::swarm
