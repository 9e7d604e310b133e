// What the burning glass says of itself, the ranges of its settings, and its rates. Lengths in field radii.
#pragma once

#include "games/game.h"

namespace parallax::burning {

inline constexpr double kLeastFocalLength = 0.75, kMostFocalLength = 4, kUsualFocalLength = 1.5;
inline constexpr double kLeastDiameter = 0.25, kMostDiameter = 0.8, kUsualDiameter = 0.5;
inline constexpr int kRaysPerTick = 2048;
inline constexpr int kTicksPerPicture = kGameTicksPerSecond / 15;  // pictures of light and char: 15 a second
inline constexpr double kLeastElevation_deg = 12, kMostElevation_deg = 90;

const GameInfo& burning_glass_info();

}  // namespace parallax::burning
