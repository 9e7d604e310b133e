// What is written over a game: score, gauges, messages, the cross-hairs, the count-down. Drawn with Dear ImGui, in the
// window and in videos alike, legible at 640x480.
//
// Between ImGui::NewFrame() and ImGui::Render(), on the thread of the current context.
#pragma once

#include <string>

#include "app/augmented_interface.h"
#include "games/game.h"

namespace parallax {

struct GameHudView {
  PictureArea area;
  std::string title;
  GameHud hud;
  std::string status;   // GameSession::status(): in the middle of the picture
  std::string below{};  // a smaller line below it: what can be done now
  // Where its optical axis lies in the picture the cross-hairs are; null: in the middle.
  const CameraModel* camera = nullptr;
  bool begun = true;  // else there is no score yet, and nothing to say but the status
};

void draw_game_hud(const GameHudView& view);

}  // namespace parallax
