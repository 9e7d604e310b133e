// A public building for a robot with two cameras: a corridor round a rectangle of about 35 by 15 m, a staircase with a
// landing half way, and a stretch of the floor above; and how a camera goes about in it.
//
// World: z up, metres, floor z = 0, origin in the middle of the south-west corner of the corridor. Its legs in the
// order of the walk: south (along +x), east (+y), north (-x), west (-y). The stairs begin west of the origin. Pure
// functions and values, safe from any thread.
#pragma once

#include <cstdint>

#include "render/synthetic_path.h"
#include "render/synthetic_scene.h"

namespace parallax {

// The corridor's middle line, and its walls.
inline constexpr double kBuildingLength = 33.0, kBuildingWidth = 13.2;
inline constexpr double kCorridorHalfWidth = 1.1, kCorridorHeight = 2.6;
// The stairs: two flights of so many risers, in lanes either side of a low wall, up along -x and back along +x.
inline constexpr double kStairsFoot = -2.3, kStairsTread = 0.28, kStairsRiser = 0.16, kStairsLanding = 1.28;
inline constexpr int kStairsRisers = 10;  // of each flight
inline constexpr double kUpperFloor = 2 * kStairsRisers * kStairsRiser, kUpperEnd = 13.1;
inline constexpr double kStairsTurn = kStairsFoot - (kStairsRisers - 1) * kStairsTread;  // where the landing begins

// Day: each day after day 0 a third of what can be moved (posters, boxes, bins) is elsewhere or other than the day
// before, some lamps are off, and the windows are of another brightness.
SyntheticScene build_building_scene(std::uint64_t seed, int day = 0);

// Walks: 0 the loop, on wheels, ending 1.1 times round; 1 the same way round from the north leg, on wheels; 2 the other
// way round from the east leg, on wheels; 3 hand-held from the west leg through south and east; 4 hand-held from the
// north leg through the west one and up the stairs; kBuildingStairs hand-held from the south leg up the stairs and
// along.
inline constexpr int kBuildingWalks = 6, kBuildingStairs = 5;
inline constexpr double kBuildingFps = 20;

// The walk's own number of frames. Walks 0 to 2 go on round and round for as many as are asked for; the others then
// stand still. The seed varies sway and lane.
int building_walk_frames(int walk);
SyntheticMotion building_motion(int walk, std::uint64_t seed);

}  // namespace parallax
