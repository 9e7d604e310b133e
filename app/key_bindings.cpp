#include "app/key_bindings.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "core/error.h"

namespace parallax {

namespace {

struct ActionText {
  const char* name;
  const char* help;
};
constexpr std::array<ActionText, kActions> kActionTexts = {{
    {"initialise", "start, and end, the sideways slide that initialises"},
    {"reset", "forget the map"},
    {"map_view", "the map, from outside: on and off"},
    {"next_game", "games: the menu; in it the next one"},
    {"calibrate", "calibrate the camera"},
    {"label", "a label where the cursor points"},
    {"model", "a model where the cursor points"},
    {"erase", "remove what the cursor points at"},
    {"measure", "set the scale: click two points, type their distance"},
    {"plane", "find the plane again, at the cursor"},
    {"help", "this help; in a game, how it is played"},
    {"camera_panel", "camera: format, rate, controls"},
    {"map_panel", "map: what it holds, plane, scale"},
    {"content_panel", "labels and models"},
    {"record_panel", "recording, video, screenshots"},
    {"debug_panel", "timings"},
    {"maps_panel", "the list of maps"},
    {"video", "record a video of the window"},
    {"full_screen", "full screen"},
    {"screenshot", "screenshot"},
    {"quit", "quit"},
    {"game_pause", "games: pause, and go on"},
    {"game_act", "games: the second button (bomb, undo...)"},
    {"game_more", "games: more (focal length...)"},
    {"game_less", "games: less"},
    {"move_left", "synthetic camera: left"},
    {"move_right", "synthetic camera: right"},
    {"move_up", "synthetic camera: up"},
    {"move_down", "synthetic camera: down"},
    {"move_forward", "synthetic camera: forward"},
    {"move_back", "synthetic camera: back"},
}};

constexpr std::pair<const char*, int> kKeyNames[] = {
    {"Space", GLFW_KEY_SPACE},
    {"Enter", GLFW_KEY_ENTER},
    {"Escape", GLFW_KEY_ESCAPE},
    {"Tab", GLFW_KEY_TAB},
    {"Backspace", GLFW_KEY_BACKSPACE},
    {"Insert", GLFW_KEY_INSERT},
    {"Delete", GLFW_KEY_DELETE},
    {"Left", GLFW_KEY_LEFT},
    {"Right", GLFW_KEY_RIGHT},
    {"Up", GLFW_KEY_UP},
    {"Down", GLFW_KEY_DOWN},
    {"PageUp", GLFW_KEY_PAGE_UP},
    {"PageDown", GLFW_KEY_PAGE_DOWN},
    {"Home", GLFW_KEY_HOME},
    {"End", GLFW_KEY_END},
    {"Pause", GLFW_KEY_PAUSE},
    {"Menu", GLFW_KEY_MENU},
    {"KeypadEnter", GLFW_KEY_KP_ENTER},
    {"Comma", GLFW_KEY_COMMA},
    {"Period", GLFW_KEY_PERIOD},
    {"Minus", GLFW_KEY_MINUS},
    {"Equal", GLFW_KEY_EQUAL},
    {"Slash", GLFW_KEY_SLASH},
    {"Semicolon", GLFW_KEY_SEMICOLON},
};
constexpr std::pair<const char*, int> kModifierNames[] = {
    {"Ctrl", GLFW_MOD_CONTROL}, {"Alt", GLFW_MOD_ALT}, {"Shift", GLFW_MOD_SHIFT}, {"Super", GLFW_MOD_SUPER}};
// What an action takes when its only key was given to another.
constexpr std::pair<Action, const char*> kSecondChoices[] = {
    {Action::next_game, "Shift+G"},     {Action::game_pause, "Pause"},     {Action::game_act, "V"},
    {Action::game_more, "Period"},      {Action::game_less, "Comma"},      {Action::help, "Shift+F1"},
    {Action::camera_panel, "Shift+F2"}, {Action::map_panel, "Shift+F3"},   {Action::content_panel, "Shift+F4"},
    {Action::record_panel, "Shift+F5"}, {Action::debug_panel, "Shift+F6"}, {Action::maps_panel, "Shift+F7"}};
constexpr int kModifiers = GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SHIFT | GLFW_MOD_SUPER;

bool same_word(const std::string& a, const std::string& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

std::optional<int> parse_key(const std::string& word) {
  for (const auto& [name, key] : kKeyNames)
    if (same_word(word, name)) return key;
  if (word.size() == 1 && std::isalnum(static_cast<unsigned char>(word[0])))
    return std::toupper(static_cast<unsigned char>(word[0]));  // GLFW's letters and digits are those of ASCII
  if (word.size() >= 2 && word.size() <= 3 && (word[0] == 'F' || word[0] == 'f') &&
      std::all_of(word.begin() + 1, word.end(), [](unsigned char c) { return std::isdigit(c); })) {
    const int number = std::stoi(word.substr(1));
    if (number >= 1 && number <= 25) return GLFW_KEY_F1 + number - 1;
  }
  return std::nullopt;
}

std::size_t row(Action action) { return static_cast<std::size_t>(action); }

// Throws when two actions share a key.
void check_unique(const KeyBindings& bindings) {
  for (int a = 0; a < kActions; ++a) {
    for (int b = a + 1; b < kActions; ++b) {
      for (const KeyChord& chord : bindings.chords(static_cast<Action>(a))) {
        const auto& others = bindings.chords(static_cast<Action>(b));
        if (std::find(others.begin(), others.end(), chord) == others.end()) continue;
        throw InputError("key " + key_chord_name(chord) + ": found at " + action_name(static_cast<Action>(a)) +
                         " and at " + action_name(static_cast<Action>(b)) + ", expected at one of them");
      }
    }
  }
}

}  // namespace

const char* action_name(Action action) { return kActionTexts[row(action)].name; }
const char* action_help(Action action) { return kActionTexts[row(action)].help; }

std::optional<Action> parse_action(const std::string& name) {
  for (int i = 0; i < kActions; ++i)
    if (name == kActionTexts[static_cast<std::size_t>(i)].name) return static_cast<Action>(i);
  return std::nullopt;
}

std::optional<KeyChord> parse_key_chord(const std::string& text) {
  KeyChord chord;
  std::string rest = text;
  for (auto plus = rest.find('+'); plus != std::string::npos; plus = rest.find('+')) {
    const std::string word = rest.substr(0, plus);
    const auto* modifier = std::find_if(std::begin(kModifierNames), std::end(kModifierNames),
                                        [&](const auto& m) { return same_word(word, m.first); });
    if (modifier == std::end(kModifierNames)) return std::nullopt;
    chord.modifiers |= modifier->second;
    rest.erase(0, plus + 1);
  }
  const auto key = parse_key(rest);
  if (!key) return std::nullopt;
  chord.key = *key;
  return chord;
}

std::string key_chord_name(const KeyChord& chord) {
  std::string name;
  for (const auto& [word, bit] : kModifierNames)
    if ((chord.modifiers & bit) != 0) name += std::string(word) + "+";
  for (const auto& [word, key] : kKeyNames)
    if (key == chord.key) return name + word;
  if (chord.key >= GLFW_KEY_F1 && chord.key <= GLFW_KEY_F25)
    return name + "F" + std::to_string(chord.key - GLFW_KEY_F1 + 1);
  return name + static_cast<char>(chord.key);
}

KeyBindings::KeyBindings() : chords_(kActions) {
  const auto bind = [&](Action action, const char* key) { chords_[row(action)].push_back(*parse_key_chord(key)); };
  bind(Action::initialise, "Space");
  bind(Action::initialise, "Enter");
  bind(Action::reset, "R");
  bind(Action::map_view, "M");
  bind(Action::next_game, "G");
  bind(Action::calibrate, "C");
  bind(Action::label, "L");
  bind(Action::model, "O");
  bind(Action::erase, "Delete");
  bind(Action::measure, "T");
  bind(Action::plane, "P");
  bind(Action::help, "F1");
  bind(Action::camera_panel, "F2");
  bind(Action::map_panel, "F3");
  bind(Action::content_panel, "F4");
  bind(Action::record_panel, "F5");
  bind(Action::debug_panel, "F6");
  bind(Action::maps_panel, "F7");
  bind(Action::video, "F9");
  bind(Action::full_screen, "F11");
  bind(Action::screenshot, "F12");
  bind(Action::quit, "Escape");
  bind(Action::quit, "Q");
  bind(Action::game_pause, "B");
  bind(Action::game_act, "E");
  bind(Action::game_more, "X");
  bind(Action::game_less, "Z");
  bind(Action::move_left, "Left");
  bind(Action::move_left, "A");
  bind(Action::move_right, "Right");
  bind(Action::move_right, "D");
  bind(Action::move_up, "PageUp");
  bind(Action::move_down, "PageDown");
  bind(Action::move_forward, "Up");
  bind(Action::move_forward, "W");
  bind(Action::move_back, "Down");
  bind(Action::move_back, "S");
}

void KeyBindings::set(Action action, std::vector<KeyChord> chords) {
  KeyBindings changed = *this;
  changed.chords_[row(action)] = std::move(chords);
  check_unique(changed);
  *this = std::move(changed);
}

const std::vector<KeyChord>& KeyBindings::chords(Action action) const { return chords_[row(action)]; }

std::optional<Action> KeyBindings::action_of(int key, int modifiers) const {
  const KeyChord pressed{key, modifiers & kModifiers};
  for (std::size_t i = 0; i < chords_.size(); ++i)
    if (std::find(chords_[i].begin(), chords_[i].end(), pressed) != chords_[i].end()) return static_cast<Action>(i);
  return std::nullopt;
}

std::string KeyBindings::chord_names(Action action) const {
  std::string names;
  for (const KeyChord& chord : chords(action)) names += (names.empty() ? "" : ", ") + key_chord_name(chord);
  return names.empty() ? "none" : names;
}

std::vector<YieldedKey> set_keys(const std::vector<std::pair<Action, std::vector<KeyChord>>>& wanted,
                                 KeyBindings* bindings) {
  KeyBindings changed = *bindings;
  std::array<bool, kActions> named{};
  for (const auto& [action, chords] : wanted) named[row(action)] = true;
  std::vector<YieldedKey> yielded;
  std::array<bool, kActions> robbed{};
  const auto taker = [&](const KeyChord& chord) -> std::optional<Action> {
    for (const auto& [action, chords] : wanted)
      if (std::find(chords.begin(), chords.end(), chord) != chords.end()) return action;
    return std::nullopt;
  };
  for (int i = 0; i < kActions; ++i) {
    const auto action = static_cast<Action>(i);
    if (named[row(action)]) {
      changed.set(action, {});
      continue;
    }
    std::vector<KeyChord> left;
    for (const KeyChord& chord : bindings->chords(action)) {
      if (const auto to = taker(chord)) {
        yielded.push_back({chord, action, *to});
        robbed[row(action)] = true;
      } else {
        left.push_back(chord);
      }
    }
    changed.set(action, std::move(left));
  }
  for (const auto& [action, chords] : wanted) changed.set(action, chords);
  for (const auto& [action, key] : kSecondChoices) {
    const auto chord = parse_key_chord(key);
    if (!robbed[row(action)] || !changed.chords(action).empty() || changed.action_of(chord->key, chord->modifiers))
      continue;
    changed.set(action, {*chord});
  }
  *bindings = changed;
  return yielded;
}

std::vector<std::string> yielded_text(const std::vector<YieldedKey>& yielded, const KeyBindings& bindings) {
  std::vector<std::string> out;
  for (const YieldedKey& y : yielded) {
    const bool none = bindings.chords(y.from).empty();
    out.push_back(key_chord_name(y.chord) + " is yours for " + action_name(y.to) + ": " + action_name(y.from) +
                  (none ? " has no key now" : " has " + bindings.chord_names(y.from) + " now"));
  }
  return out;
}

}  // namespace parallax
