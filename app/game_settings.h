// What can be set of the games, as rows of a panel: a label, what it is now, and steps to either side. The panel, the
// keys and a gamepad all change GameStore through these. Values; no window.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/game_store.h"
#include "games/game.h"

namespace parallax {

struct GameSettingRow {
  enum class Kind { volume, effects, sound, difficulty, palette, seated, occlusion, own };
  Kind kind = Kind::own;
  std::string label, value;
  std::optional<double> share;  // 0..1, of what slides; nothing: a choice
  bool later = false;           // holds from the next game on
  std::string own;              // GameSetting::name, of Kind::own
};

// Of all games, then those of this one.
std::vector<GameSettingRow> game_setting_rows(const GameStore& store, const GameInfo& info);

// One step more (1) or less (-1): what slides stops at its ends, a choice goes round.
void step_game_setting(const GameSettingRow& row, const GameInfo& info, int step, GameStore* store);
// Sets what slides to that share.
void slide_game_setting(const GameSettingRow& row, const GameInfo& info, double share, GameStore* store);

// What a game's own setting is now.
double own_setting(const GameStore& store, const GameInfo& info, const std::string& name);

}  // namespace parallax
