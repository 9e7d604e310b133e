// One colour a pyramid level, in every view.
#pragma once

#include <array>

#include "core/image.h"
#include "render/draw_list.h"

namespace parallax {

// Told apart by colour-blind people too (Okabe and Ito's set): yellow, sky blue, bluish green, and vermilion for the
// coarsest level.
const std::array<DrawColour, kPyramidLevels>& level_colours();

// The colour of a level; levels that do not exist get the nearest one's.
DrawColour level_colour(int level);

}  // namespace parallax
