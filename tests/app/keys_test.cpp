// Key names, bindings and what happens when two actions want one key.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <gtest/gtest.h>

#include "app/key_bindings.h"
#include "core/error.h"

namespace parallax::testing {
namespace {

TEST(Keys, NamesRoundTrip) {
  for (const char* name : {"Space", "Enter", "Escape", "A", "Z", "0", "9", "F1", "F12", "F25", "Ctrl+M", "Shift+Left",
                           "Ctrl+Alt+Shift+Super+PageDown", "KeypadEnter"}) {
    const auto chord = parse_key_chord(name);
    ASSERT_TRUE(chord.has_value()) << name;
    EXPECT_EQ(key_chord_name(*chord), name);
  }
  EXPECT_EQ(parse_key_chord("ctrl+m"), parse_key_chord("Ctrl+M"));
  EXPECT_EQ(parse_key_chord("f9")->key, GLFW_KEY_F9);
  EXPECT_EQ(parse_key_chord("q")->key, GLFW_KEY_Q);
}

TEST(Keys, WhatIsNoKey) {
  for (const char* name : {"", "+", "Ctrl+", "Spcae", "F0", "F26", "F1x", "Hyper+A", "AB", "\xc3\xa4"})
    EXPECT_FALSE(parse_key_chord(name).has_value()) << name;
}

TEST(Keys, EveryActionHasItsNameAndHelp) {
  for (int i = 0; i < kActions; ++i) {
    const auto action = static_cast<Action>(i);
    EXPECT_EQ(parse_action(action_name(action)), action);
    EXPECT_GT(std::string(action_help(action)).size(), 3u);
  }
  EXPECT_FALSE(parse_action("fly").has_value());
}

TEST(Keys, DefaultsAreThoseOfTheDesign) {
  const KeyBindings keys;
  EXPECT_EQ(keys.action_of(GLFW_KEY_SPACE, 0), Action::initialise);
  EXPECT_EQ(keys.action_of(GLFW_KEY_ENTER, 0), Action::initialise);
  EXPECT_EQ(keys.action_of(GLFW_KEY_R, 0), Action::reset);
  EXPECT_EQ(keys.action_of(GLFW_KEY_M, 0), Action::map_view);
  EXPECT_EQ(keys.action_of(GLFW_KEY_G, 0), Action::next_game);
  EXPECT_EQ(keys.action_of(GLFW_KEY_C, 0), Action::calibrate);
  EXPECT_EQ(keys.action_of(GLFW_KEY_F1, 0), Action::help);
  EXPECT_EQ(keys.action_of(GLFW_KEY_ESCAPE, 0), Action::quit);
  EXPECT_EQ(keys.action_of(GLFW_KEY_Q, 0), Action::quit);
  EXPECT_EQ(keys.action_of(GLFW_KEY_F12, 0), Action::screenshot);
  // No key is bound twice: setting any action to what it has is accepted.
  for (int i = 0; i < kActions; ++i) {
    KeyBindings same;
    const auto action = static_cast<Action>(i);
    EXPECT_NO_THROW(same.set(action, keys.chords(action))) << action_name(action);
  }
}

TEST(Keys, ModifiersCountAndLocksDoNot) {
  const KeyBindings keys;
  EXPECT_FALSE(keys.action_of(GLFW_KEY_M, GLFW_MOD_CONTROL).has_value());
  EXPECT_EQ(keys.action_of(GLFW_KEY_M, GLFW_MOD_CAPS_LOCK | GLFW_MOD_NUM_LOCK), Action::map_view);
}

TEST(Keys, ATakenKeyIsRefusedAndNothingChanges) {
  KeyBindings keys;
  try {
    keys.set(Action::map_view, {*parse_key_chord("R")});
    ADD_FAILURE() << "R was given to two actions";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("reset"), std::string::npos) << e.what();
  }
  EXPECT_EQ(keys, KeyBindings());
}

TEST(Keys, TwoActionsCanSwap) {
  KeyBindings keys;
  set_keys({{Action::map_view, {*parse_key_chord("R")}}, {Action::reset, {*parse_key_chord("M")}}}, &keys);
  EXPECT_EQ(keys.action_of(GLFW_KEY_R, 0), Action::map_view);
  EXPECT_EQ(keys.action_of(GLFW_KEY_M, 0), Action::reset);
  EXPECT_EQ(keys.chord_names(Action::initialise), "Space, Enter");
}

TEST(Keys, AKeyOfTheUsersIsTakenFromADefault) {
  KeyBindings keys;
  const auto yielded = set_keys({{Action::label, {*parse_key_chord("E"), *parse_key_chord("A")}}}, &keys);
  EXPECT_EQ(keys.action_of(GLFW_KEY_E, 0), Action::label);
  EXPECT_EQ(keys.action_of(GLFW_KEY_A, 0), Action::label);
  EXPECT_EQ(keys.chord_names(Action::game_act), "V") << "its second choice";
  EXPECT_EQ(keys.chord_names(Action::move_left), "Left") << "what is left of two is enough";
  ASSERT_EQ(yielded.size(), 2u);
  const auto text = yielded_text(yielded, keys);
  EXPECT_EQ(text[0], "E is yours for label: game_act has V now");
  EXPECT_EQ(text[1], "A is yours for label: move_left has Left now");
}

TEST(Keys, WithoutASecondChoiceAnActionHasNoKey) {
  KeyBindings keys;
  // The second choice is taken as well; and one who wanted a key twice is told as before.
  const auto yielded = set_keys({{Action::label, {*parse_key_chord("E"), *parse_key_chord("V")}}}, &keys);
  ASSERT_EQ(yielded.size(), 1u);
  EXPECT_TRUE(keys.chords(Action::game_act).empty());
  EXPECT_EQ(yielded_text(yielded, keys)[0], "E is yours for label: game_act has no key now");
  KeyBindings twice;
  EXPECT_THROW(set_keys({{Action::label, {*parse_key_chord("F")}}, {Action::model, {*parse_key_chord("F")}}}, &twice),
               InputError);
  EXPECT_EQ(twice, KeyBindings());
}

// Settings of before there were games, which gave any one key to any one action.
TEST(Keys, NoSingleKeyOfTheUsersIsRefused) {
  const KeyBindings defaults;
  for (int i = 0; i < kActions; ++i) {
    for (const KeyChord& chord : defaults.chords(static_cast<Action>(i))) {
      for (int to = 0; to < kActions; ++to) {
        KeyBindings keys;
        set_keys({{static_cast<Action>(to), {chord}}}, &keys);
        EXPECT_EQ(keys.action_of(chord.key, chord.modifiers), static_cast<Action>(to));
        for (int same = 0; same < kActions; ++same)  // no key has two actions
          EXPECT_NO_THROW(keys.set(static_cast<Action>(same), keys.chords(static_cast<Action>(same))));
      }
    }
  }
}

}  // namespace
}  // namespace parallax::testing
