#include "app/game_settings.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "app/game_palette.h"

namespace parallax {
namespace {

using RowKind = GameSettingRow::Kind;

constexpr double kStepsAcross = 10;

std::string percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }
const char* on_or_off(bool on) { return on ? "on" : "off"; }

const GameSetting* setting_of(const GameInfo& info, const std::string& name) {
  const auto found =
      std::find_if(info.settings.begin(), info.settings.end(), [&](const GameSetting& s) { return s.name == name; });
  return found == info.settings.end() ? nullptr : &*found;
}

GameSettingRow own_row(const GameStore& store, const GameInfo& info, const GameSetting& setting) {
  GameSettingRow row;
  row.own = setting.name;
  row.label = setting.label;
  const double value = own_setting(store, info, setting.name);
  if (!setting.choices.empty()) {
    row.value = setting.choices[static_cast<std::size_t>(std::lround(value))];
    return row;
  }
  char text[48];
  std::snprintf(text, sizeof text, std::abs(setting.most - setting.least) >= 20 ? "%.0f" : "%.2f", value);
  row.value = text + (setting.unit.empty() ? "" : " " + setting.unit);
  row.share = (value - setting.least) / (setting.most - setting.least);
  return row;
}

void set_own(const GameSetting& setting, const GameInfo& info, double value, GameStore* store) {
  store->settings[info.name][setting.name] = std::clamp(value, setting.least, setting.most);
}

int around(int index, int step, int count) { return ((index + step) % count + count) % count; }

}  // namespace

double own_setting(const GameStore& store, const GameInfo& info, const std::string& name) {
  const GameSetting* setting = setting_of(info, name);
  if (setting == nullptr) return 0;
  double value = setting->initial;
  if (const auto game = store.settings.find(info.name); game != store.settings.end())
    if (const auto kept = game->second.find(name); kept != game->second.end()) value = kept->second;
  if (!std::isfinite(value)) value = setting->initial;
  const double most = setting->choices.empty() ? setting->most : static_cast<double>(setting->choices.size() - 1);
  return std::clamp(value, setting->choices.empty() ? setting->least : 0.0, most);
}

std::vector<GameSettingRow> game_setting_rows(const GameStore& store, const GameInfo& info) {
  std::vector<GameSettingRow> rows{
      {RowKind::volume, "Volume", percent(store.volume), store.volume, false, ""},
      {RowKind::effects, "Effects", percent(store.effects), store.effects, false, ""},
      {RowKind::sound, "Sound", on_or_off(!store.mute), std::nullopt, false, ""},
      {RowKind::difficulty, "Difficulty", difficulty_name(store.difficulty), std::nullopt, true, ""},
      {RowKind::seated, "Seated: little camera motion", on_or_off(store.seated), std::nullopt, true, ""},
      {RowKind::palette, "Colours", game_palette(store.palette).title, std::nullopt, false, ""},
      {RowKind::occlusion, "Real things hide virtual ones", on_or_off(store.occlusion), std::nullopt, false, ""}};
  const GamePalette& palette = game_palette(store.palette);
  if (!palette.colour_blind_safe)
    std::find_if(rows.begin(), rows.end(), [](const auto& r) { return r.kind == RowKind::palette; })->value +=
        " (not colour-blind safe)";
  for (const GameSetting& setting : info.settings) rows.push_back(own_row(store, info, setting));
  return rows;
}

void step_game_setting(const GameSettingRow& row, const GameInfo& info, int step, GameStore* store) {
  if (row.share) return slide_game_setting(row, info, *row.share + step / kStepsAcross, store);
  switch (row.kind) {
    case RowKind::volume:
    case RowKind::effects:
      break;  // they slide
    case RowKind::sound:
      store->mute = !store->mute;
      break;
    case RowKind::difficulty:
      store->difficulty = static_cast<GameDifficulty>(around(static_cast<int>(store->difficulty), step, 3));
      break;
    case RowKind::seated:
      store->seated = !store->seated;
      break;
    case RowKind::palette: {
      const auto& all = game_palettes();
      const auto now = static_cast<int>(&game_palette(store->palette) - all.data());
      store->palette = all[static_cast<std::size_t>(around(now, step, static_cast<int>(all.size())))].name;
      break;
    }
    case RowKind::occlusion:
      store->occlusion = !store->occlusion;
      break;
    case RowKind::own:
      if (const GameSetting* setting = setting_of(info, row.own); setting != nullptr && !setting->choices.empty()) {
        const auto now = static_cast<int>(std::lround(own_setting(*store, info, row.own)));
        store->settings[info.name][row.own] = around(now, step, static_cast<int>(setting->choices.size()));
      }
      break;
  }
}

void slide_game_setting(const GameSettingRow& row, const GameInfo& info, double share, GameStore* store) {
  share = std::clamp(share, 0.0, 1.0);
  if (row.kind == RowKind::volume) store->volume = share;
  if (row.kind == RowKind::effects) store->effects = share;
  if (row.kind != RowKind::own) return;
  if (const GameSetting* setting = setting_of(info, row.own); setting != nullptr && setting->choices.empty())
    set_own(*setting, info, setting->least + share * (setting->most - setting->least), store);
}

}  // namespace parallax
