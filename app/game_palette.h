// The colours that tell things apart in the games, and other sets of them by name. Games draw with the set of Okabe and
// Ito; a filter replaces those colours, in models too and in every shade of them, by those of the set that was chosen.
//
//   okabe_ito    Okabe, Ito: Color Universal Design (2008)
//   tol_muted    Tol: Colour Schemes, SRON/EPS/TN/09-002, issue 3.2 (2021), "muted"
//   tol_vibrant  the same, "vibrant"
//   vivid        richer colours, for those who see all of them: not safe for the colour-blind
//
// Colours: sRGB-encoded 0..1. Palettes are values, safe from any thread; a filter belongs to one thread.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "games/game.h"
#include "render/draw_list.h"

namespace parallax {

// By the colours of Okabe and Ito.
enum class PaletteRole { orange, sky, green, yellow, blue, vermillion, purple };
inline constexpr std::size_t kPaletteRoles = 7;

struct GamePalette {
  std::string name;   // as it is kept: "okabe_ito"
  std::string title;  // as it is shown
  bool colour_blind_safe = true;
  std::array<DrawColour, kPaletteRoles> colours;
  const DrawColour& colour(PaletteRole role) const { return colours[static_cast<std::size_t>(role)]; }
};

// The first is what games draw with.
const std::vector<GamePalette>& game_palettes();
// The first when there is none of that name.
const GamePalette& game_palette(const std::string& name);

// A colour of the first palette, or a shade of one (the same mixture, less light), as the palette has it; any other as
// it is.
DrawColour recoloured(const DrawColour& colour, const GamePalette& palette);

// How much of a list there was before a game was drawn into it.
struct DrawnBefore {
  std::size_t meshes = 0, sprites = 0, world_lines = 0, world_points = 0, screen_lines = 0, screen_points = 0;
  static DrawnBefore of(const DrawList& list);
};

class PaletteFilter {
 public:
  void set(const GamePalette& palette);
  // What was drawn since.
  void apply(const DrawnBefore& before, DrawList* list);
  void apply(GameHud* hud) const;

 private:
  std::shared_ptr<const Mesh> recoloured_mesh(const std::shared_ptr<const Mesh>& mesh);

  const GamePalette* palette_ = &game_palettes().front();
  std::map<std::shared_ptr<const Mesh>, std::shared_ptr<const Mesh>> made_;  // the same mesh: nothing to change in it
};

}  // namespace parallax
