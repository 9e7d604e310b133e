// The builders behind synthetic_scene(): each paints its pictures and places its furniture. World frame, z up, metres.
#pragma once

#include <cstdint>
#include <string>

#include "render/synthetic_scene.h"

namespace parallax {

SyntheticScene build_synthetic_scene(const std::string& name, std::uint64_t seed, int day = 0);

// A cluttered table top at z = 0, 1.7 m by 1.0 m about the origin, in a room with walls, shelf and floor; and, 20 m to
// the right and out of sight, a second corner with other furniture about (20, 0, 0) that `shakes` visits. Day: as in
// synthetic_scene(); at most kLastSyntheticDay.
SyntheticScene build_desk_scene(std::uint64_t seed, int day = 0);
inline constexpr int kLastSyntheticDay = 1000;
// PTAM §7.3: two textured walls at right angles, y = 2.5 and x = kWallsCornerX, 6 m high.
SyntheticScene build_walls_scene(std::uint64_t seed);
// A table of strictly repeating tiles with a repeating wall, and three small unique things.
SyntheticScene build_repeat_scene(std::uint64_t seed);
// A table and a wall of one colour.
SyntheticScene build_blank_scene();
// A furnished room, 5 m by 5 m by 2.6 m about the origin, floor z = 0.
SyntheticScene build_room_scene(std::uint64_t seed);

// The walls: the camera keeps this distance, turns the corner on this radius, and travels this far in all (PTAM §7.3).
inline constexpr double kWallsDistance = 2.5, kWallsTurnRadius = 1.5, kWallsTravel = 18.2, kWallsCameraHeight = 3.0;
// Length of each straight part, and where the corner between the walls is: (kWallsCornerX, kWallsDistance).
inline constexpr double kWallsStraight = (kWallsTravel - kWallsTurnRadius * 1.5707963267948966) / 2;
inline constexpr double kWallsCornerX = kWallsStraight + kWallsTurnRadius + kWallsDistance;

}  // namespace parallax
