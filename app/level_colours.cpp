#include "app/level_colours.h"

#include <algorithm>

namespace parallax {

const std::array<DrawColour, kPyramidLevels>& level_colours() {
  static const std::array<DrawColour, kPyramidLevels> colours = {
      DrawColour{240 / 255.0f, 228 / 255.0f, 66 / 255.0f, 1}, DrawColour{86 / 255.0f, 180 / 255.0f, 233 / 255.0f, 1},
      DrawColour{0, 158 / 255.0f, 115 / 255.0f, 1}, DrawColour{213 / 255.0f, 94 / 255.0f, 0, 1}};
  return colours;
}

DrawColour level_colour(int level) {
  return level_colours()[static_cast<std::size_t>(std::clamp(level, 0, kPyramidLevels - 1))];
}

}  // namespace parallax
