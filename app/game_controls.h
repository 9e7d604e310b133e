// Keys, mouse and gamepad, turned into what a player does. Values of one moment; the window asks them every frame.
#pragma once

#include <string>
#include <vector>

#include "app/key_bindings.h"
#include "games/game.h"

namespace parallax {

// What is held down now.
struct GameKeys {
  bool left = false, right = false, away = false, near = false;  // of the player: away from the viewer
  bool fire = false, act = false, more = false, less = false;    // more, less: the dial
};

// A gamepad in GLFW's mapping: sticks -1..1 (y down), triggers -1 (free) to 1.
struct GamePad {
  bool present = false;
  float left_x = 0, left_y = 0;
  float left_trigger = -1, right_trigger = -1;
  bool a = false, b = false, left_bumper = false, right_bumper = false;
  bool x = false, y = false, back = false, start = false;
  bool dpad_left = false, dpad_right = false, dpad_up = false, dpad_down = false;
};

// Sticks rest anywhere within this of their middle.
inline constexpr double kStickRest = 0.18;

// Both together; the longer of two movements counts. Without a pose, which GameSession adds.
GameInput game_input(const GameKeys& keys, const GamePad& pad);

// The gamepad that is plugged in, as GLFW knows it; not present when there is none, or no window was opened. The
// window's thread.
GamePad read_game_pad();

// What was pressed on a gamepad since the last time, for menus: the stick counts as a cross once it is half over.
struct PadPresses {
  bool left = false, right = false, up = false, down = false;
  bool accept = false, cancel = false, next = false, pause = false, help = false;
};
class PadWatch {
 public:
  PadPresses update(const GamePad& pad);

 private:
  PadPresses held_;
};

// How a game is played: "drives the robot", with the keys as they are bound and what it is on a gamepad. What a game
// does not use is left out.
struct GameControlRow {
  std::string does, keys, gamepad;
};
std::vector<GameControlRow> game_control_rows(const GameInfo& info, const KeyBindings& keys);

}  // namespace parallax
