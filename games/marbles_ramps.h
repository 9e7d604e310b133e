// Ramps of Marbles: from the table onto low real things with level tops.
//
// Units and frame as in games/marbles_ground.h. Plain functions.
#pragma once

#include <vector>

#include "games/marbles_ground.h"
#include "games/marbles_random.h"

namespace parallax {

// At most so many ramps, each of which makes room on top of something reachable from the greatest free area.
std::vector<TableRamp> place_ramps(const TableGround& ground, int most, MarblesRandom* random);

// Adapts ramps to tops that have changed a little, and takes away those that do not fit what stands there now.
void mend_ramps(const TableGround& ground, std::vector<TableRamp>* ramps);

}  // namespace parallax
