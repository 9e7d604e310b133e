// The menu of the games, its settings, and what it says of keys; as they are gone through with keys and gamepad.
#include "app/game_menu.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "app/game_controls.h"
#include "app/game_palette.h"
#include "app/game_settings.h"

namespace parallax {
namespace {

using Kind = MenuChoice::Kind;

TEST(GameMenu, TheKeyCyclesAndTheFirstTimeIsExplained) {
  GameMenu menu(menu_games());
  GameStore store;
  ASSERT_EQ(menu.games().size(), 3u);
  EXPECT_EQ(menu.press(MenuKey::accept, &store).kind, Kind::none) << "closed";
  menu.open({});
  EXPECT_EQ(menu.selected(), 0u);
  menu.press(MenuKey::next, &store);
  EXPECT_EQ(menu.selected(), 1u);
  menu.press(MenuKey::next, &store);
  menu.press(MenuKey::next, &store);
  EXPECT_EQ(menu.selected(), 0u) << "round";
  menu.press(MenuKey::left, &store);
  EXPECT_EQ(menu.selected(), 2u);
  EXPECT_EQ(menu.press(MenuKey::accept, &store).kind, Kind::none);
  EXPECT_EQ(menu.page(), MenuPage::explanation) << "before its first start";
  const MenuChoice choice = menu.press(MenuKey::accept, &store);
  EXPECT_EQ(choice.kind, Kind::play);
  EXPECT_EQ(choice.game, 2u);
  EXPECT_FALSE(menu.is_open());
  // The next time it is known; and the menu begins at the game after the one that is on.
  menu.open(1);
  EXPECT_EQ(menu.selected(), 2u);
  EXPECT_EQ(menu.press(MenuKey::accept, &store).kind, Kind::play);
  EXPECT_TRUE(store.explained.contains("marbles"));
  EXPECT_FALSE(store.explained.contains("swarm"));
}

TEST(GameMenu, BackLeadsOutOfEveryPage) {
  GameMenu menu(menu_games());
  GameStore store;
  menu.open({});
  menu.press(MenuKey::help, &store);
  EXPECT_EQ(menu.page(), MenuPage::explanation);
  menu.press(MenuKey::right, &store);
  menu.press(MenuKey::accept, &store);
  EXPECT_EQ(menu.page(), MenuPage::settings);
  menu.press(MenuKey::back, &store);
  EXPECT_EQ(menu.page(), MenuPage::explanation);
  menu.press(MenuKey::back, &store);
  EXPECT_EQ(menu.page(), MenuPage::cards);
  EXPECT_EQ(menu.press(MenuKey::back, &store).kind, Kind::close);
  EXPECT_FALSE(menu.is_open());
  menu.explain(1);
  EXPECT_EQ(menu.selected(), 1u);
  EXPECT_EQ(menu.press(MenuKey::help, &store).kind, Kind::close) << "the key that opened it closes it";
}

TEST(GameMenu, ButtonsAreReachedWithTheCross) {
  GameMenu menu(menu_games());
  GameStore store;
  menu.open(0);
  menu.press(MenuKey::down, &store);
  ASSERT_EQ(menu.marked(), 0u);
  const auto buttons = menu.buttons();
  const auto leave = std::find(buttons.begin(), buttons.end(), MenuButton::leave) - buttons.begin();
  ASSERT_LT(leave, static_cast<std::ptrdiff_t>(buttons.size())) << "a game is on: it can be left";
  for (std::ptrdiff_t i = 0; i < leave; ++i) menu.press(MenuKey::right, &store);
  EXPECT_EQ(menu.press(MenuKey::accept, &store).kind, Kind::leave);
  menu.open({});
  const auto without_game = menu.buttons();
  EXPECT_EQ(std::count(without_game.begin(), without_game.end(), MenuButton::leave), 0);
  menu.press(MenuKey::down, &store);
  menu.press(MenuKey::up, &store);
  EXPECT_FALSE(menu.marked()) << "back on the cards";
  // With the mouse: one click looks, the second plays.
  store.explained = {"burning_glass"};
  EXPECT_EQ(menu.click_card(1, &store).kind, Kind::none);
  EXPECT_EQ(menu.click_card(1, &store).kind, Kind::play);
  menu.open({});
  EXPECT_EQ(menu.click_button(MenuButton::back, &store).kind, Kind::close);
}

// Every row is reached from the first with `down`, and does what it says; nothing of it needs a mouse.
TEST(GameMenu, SettingsAreChangedWithTheCrossAlone) {
  GameMenu menu(menu_games());
  GameStore store;
  menu.open({});
  menu.press(MenuKey::next, &store);  // the burning glass
  menu.click_button(MenuButton::settings, &store);
  ASSERT_EQ(menu.page(), MenuPage::settings);
  const auto row_named = [&](const std::string& label) {
    const auto rows = game_setting_rows(store, menu.games()[1].info);
    const auto it = std::find_if(rows.begin(), rows.end(), [&](const auto& r) { return r.label == label; });
    EXPECT_NE(it, rows.end()) << label;
    return static_cast<std::size_t>(it - rows.begin());
  };
  const auto go_to = [&](const std::string& label) {
    const std::size_t row = row_named(label);
    for (int i = 0; i < 40 && menu.marked() != row; ++i) menu.press(MenuKey::down, &store);
    ASSERT_EQ(menu.marked(), row);
  };
  for (int i = 0; i < 20; ++i) menu.press(MenuKey::left, &store);
  EXPECT_NEAR(store.volume, 0, 1e-9) << "the first row; it stops at its end";
  go_to("Effects");
  menu.press(MenuKey::left, &store);
  EXPECT_NEAR(store.effects, 0.9, 1e-9);
  go_to("Difficulty");
  menu.press(MenuKey::right, &store);
  EXPECT_EQ(store.difficulty, GameDifficulty::hard);
  menu.press(MenuKey::accept, &store);
  EXPECT_EQ(store.difficulty, GameDifficulty::easy) << "round";
  go_to("Colours");
  std::set<std::string> palettes;
  for (std::size_t i = 0; i < game_palettes().size(); ++i) {
    menu.press(MenuKey::right, &store);
    palettes.insert(store.palette);
  }
  EXPECT_EQ(palettes.size(), game_palettes().size());
  EXPECT_EQ(store.palette, game_palettes().front().name);
  go_to("Seated: little camera motion");
  menu.press(MenuKey::accept, &store);
  EXPECT_TRUE(store.seated);
  go_to("Real things hide virtual ones");
  menu.press(MenuKey::left, &store);
  EXPECT_FALSE(store.occlusion);
  go_to("Sound");
  menu.press(MenuKey::right, &store);
  EXPECT_TRUE(store.mute);
  go_to("Sun's elevation");
  const double before = own_setting(store, menu.games()[1].info, "sun_elevation");
  menu.press(MenuKey::right, &store);
  EXPECT_GT(own_setting(store, menu.games()[1].info, "sun_elevation"), before);
  go_to("Material");
  menu.press(MenuKey::left, &store);
  EXPECT_EQ(store.settings.at("burning_glass").at("material"),
            static_cast<double>(menu.games()[1].info.settings[4].choices.size() - 1));
  EXPECT_EQ(store.options("burning_glass", 1).settings.size(), 2u) << "what was changed is what a game begins with";
}

TEST(GameSettings, NothingBreaksOnWhatWasKeptWrongly) {
  GameStore store;
  const GameInfo info = menu_games()[1].info;
  store.settings["burning_glass"] = {{"material", 99}, {"focal_length", -5}, {"lens_diameter", std::nan("")}};
  for (const GameSettingRow& row : game_setting_rows(store, info)) {
    EXPECT_FALSE(row.value.empty()) << row.label;
    EXPECT_GE(row.share.value_or(0), 0) << row.label;
    EXPECT_LE(row.share.value_or(0), 1) << row.label;
  }
}

TEST(GameControls, AreSaidAsTheyAreBoundNow) {
  KeyBindings keys;
  set_keys({{Action::initialise, {*parse_key_chord("I")}}, {Action::game_act, {*parse_key_chord("Ctrl+U")}}}, &keys);
  const auto rows = game_control_rows(menu_games()[0].info, keys);
  const auto said = [&](const std::string& text) {
    return std::any_of(rows.begin(), rows.end(), [&](const auto& row) { return row.keys == text; });
  };
  EXPECT_TRUE(said("I"));
  EXPECT_TRUE(said("Ctrl+U"));
  EXPECT_TRUE(said("Left Right Up Down, A D W S"));
  for (const MenuGame& game : menu_games()) {
    EXPECT_LE(game.info.explanation.size(), 10u) << "one screen";
    for (const std::string& line : game.info.explanation) EXPECT_LE(line.size(), 48u) << line;
    EXPECT_LE(game.line.size(), 72u);
  }
}

TEST(GameControls, AGamepadPressesOnce) {
  PadWatch watch;
  GamePad pad;
  pad.present = true;
  EXPECT_FALSE(watch.update(pad).accept);
  pad.a = true;
  pad.left_x = -0.8f;
  const PadPresses pressed = watch.update(pad);
  EXPECT_TRUE(pressed.accept);
  EXPECT_TRUE(pressed.left);
  EXPECT_FALSE(watch.update(pad).accept) << "still held";
  pad.a = false;
  watch.update(pad);
  pad.a = true;
  EXPECT_TRUE(watch.update(pad).accept);
  EXPECT_FALSE(watch.update(GamePad{}).accept) << "unplugged";
}

}  // namespace
}  // namespace parallax
