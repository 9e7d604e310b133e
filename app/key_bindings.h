// Which key does what in the live window. The keys may be changed in the settings file:
//
//   keys:
//     initialise: [Space, Enter]
//     map_view: Ctrl+M
//
// A key that is named there belongs to that action alone: another action that has it by default goes without, or takes
// its second choice where it has one, so that keys which a later version brings take none from the user.
//
// A key is written as on the keyboard: A to Z, 0 to 9, F1 to F25, Space, Enter, Escape, Tab, Left..., with Ctrl+,
// Shift+, Alt+ or Super+ in front. Values; safe from any thread.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace parallax {

enum class Action {
  initialise,
  reset,
  map_view,
  next_game,
  calibrate,
  label,
  model,
  erase,
  measure,
  plane,
  help,
  camera_panel,
  map_panel,
  content_panel,
  record_panel,
  debug_panel,
  maps_panel,
  video,
  full_screen,
  screenshot,
  quit,
  game_pause,
  // Held down: they play.
  game_act,
  game_more,
  game_less,
  // Held down: they move the synthetic hand-held camera, or in a game the player; with Shift the camera all the same.
  move_left,
  move_right,
  move_up,
  move_down,
  move_forward,
  move_back,
};
inline constexpr int kActions = static_cast<int>(Action::move_back) + 1;

// As in the settings file ("map_view"), and what it does, for the help panel ("map view on and off").
const char* action_name(Action action);
const char* action_help(Action action);
std::optional<Action> parse_action(const std::string& name);

// A key (GLFW_KEY_*) with modifiers (GLFW_MOD_SHIFT, _CONTROL, _ALT, _SUPER).
struct KeyChord {
  int key = 0;
  int modifiers = 0;
  bool operator==(const KeyChord&) const = default;
};
// "Ctrl+M"; nothing when no key is called so. Upper and lower case are the same.
std::optional<KeyChord> parse_key_chord(const std::string& text);
std::string key_chord_name(const KeyChord& chord);

class KeyBindings {
 public:
  // The keys as they are without a settings file.
  KeyBindings();

  // Replaces all keys of an action. Throws InputError, naming the other action, when a key is taken; an action may
  // have no key.
  void set(Action action, std::vector<KeyChord> chords);
  const std::vector<KeyChord>& chords(Action action) const;
  // What a pressed key means; caps and num lock do not count.
  std::optional<Action> action_of(int key, int modifiers) const;
  // "Space, Enter"; "none".
  std::string chord_names(Action action) const;

  bool operator==(const KeyBindings&) const = default;

 private:
  std::vector<std::vector<KeyChord>> chords_;  // by action
};

// A key that an action had by default and another was given.
struct YieldedKey {
  KeyChord chord;
  Action from = Action::quit, to = Action::quit;
};

// Replaces many at once, so that keys can be swapped between actions: actions that are named get exactly these keys,
// and the others keep of theirs what is not taken, which is returned. Throws InputError when a key is wanted for two
// actions.
std::vector<YieldedKey> set_keys(const std::vector<std::pair<Action, std::vector<KeyChord>>>& wanted,
                                 KeyBindings* bindings);
// One sentence for each action that yielded: "B is yours for label: game_pause has Pause now".
std::vector<std::string> yielded_text(const std::vector<YieldedKey>& yielded, const KeyBindings& bindings);

}  // namespace parallax
