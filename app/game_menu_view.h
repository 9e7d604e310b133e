// Draws the menu of the games (app/game_menu) with Dear ImGui, in the middle of the display; legible and complete at
// 640x480. What the mouse does is a press like any other.
//
// Between ImGui::NewFrame() and ImGui::Render(); the window's thread.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "app/game_menu.h"
#include "app/key_bindings.h"

namespace parallax {

struct GameMenuView {
  const KeyBindings* keys = nullptr;  // required: as they are bound now
  // A picture of each game, as SceneRenderer::picture() gives it, four by three; null: none.
  std::vector<void*> pictures;
  bool gamepad = false;        // one is there: its buttons are said
  std::set<std::string> left;  // games that go on where they were left
};

// Draws nothing when the menu is closed. What a click chose is carried out on the menu and the store, and returned.
MenuChoice draw_game_menu(const GameMenuView& view, GameMenu* menu, GameStore* store);

}  // namespace parallax
