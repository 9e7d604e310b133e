#include "app/game_controls.h"

#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace parallax {
namespace {

double axis(bool less, bool more) { return (more ? 1.0 : 0.0) - (less ? 1.0 : 0.0); }

// Nothing within its rest, from there on growing smoothly to 1.
Eigen::Vector2d without_rest(const Eigen::Vector2d& stick) {
  const double length = stick.norm();
  if (!(length > kStickRest)) return Eigen::Vector2d::Zero();
  return stick / length * std::min(1.0, (length - kStickRest) / (1 - kStickRest));
}

}  // namespace

GameInput game_input(const GameKeys& keys, const GamePad& pad) {
  GameInput input;
  input.move = {axis(keys.left, keys.right), axis(keys.near, keys.away)};
  input.fire = keys.fire;
  input.act = keys.act;
  input.dial = axis(keys.less, keys.more);
  if (pad.present) {
    const Eigen::Vector2d stick = without_rest({pad.left_x, -pad.left_y});
    const Eigen::Vector2d cross(axis(pad.dpad_left, pad.dpad_right), axis(pad.dpad_down, pad.dpad_up));
    for (const Eigen::Vector2d& other : {stick, cross})
      if (other.norm() > input.move.norm()) input.move = other;
    input.fire |= pad.a || pad.right_trigger > 0;
    input.act |= pad.b || pad.left_trigger > 0;
    if (input.dial == 0) input.dial = axis(pad.left_bumper, pad.right_bumper);
  }
  // Two keys at once are no faster than one.
  if (input.move.norm() > 1) input.move.normalize();
  return input;
}

GamePad read_game_pad() {
  GamePad pad;
  for (int id = GLFW_JOYSTICK_1; id <= GLFW_JOYSTICK_LAST; ++id) {
    GLFWgamepadstate state;
    if (!glfwJoystickIsGamepad(id) || !glfwGetGamepadState(id, &state)) continue;
    const auto down = [&](int button) { return state.buttons[button] == GLFW_PRESS; };
    pad.present = true;
    pad.left_x = state.axes[GLFW_GAMEPAD_AXIS_LEFT_X];
    pad.left_y = state.axes[GLFW_GAMEPAD_AXIS_LEFT_Y];
    pad.left_trigger = state.axes[GLFW_GAMEPAD_AXIS_LEFT_TRIGGER];
    pad.right_trigger = state.axes[GLFW_GAMEPAD_AXIS_RIGHT_TRIGGER];
    pad.a = down(GLFW_GAMEPAD_BUTTON_A);
    pad.b = down(GLFW_GAMEPAD_BUTTON_B);
    pad.x = down(GLFW_GAMEPAD_BUTTON_X);
    pad.y = down(GLFW_GAMEPAD_BUTTON_Y);
    pad.back = down(GLFW_GAMEPAD_BUTTON_BACK);
    pad.start = down(GLFW_GAMEPAD_BUTTON_START);
    pad.left_bumper = down(GLFW_GAMEPAD_BUTTON_LEFT_BUMPER);
    pad.right_bumper = down(GLFW_GAMEPAD_BUTTON_RIGHT_BUMPER);
    pad.dpad_left = down(GLFW_GAMEPAD_BUTTON_DPAD_LEFT);
    pad.dpad_right = down(GLFW_GAMEPAD_BUTTON_DPAD_RIGHT);
    pad.dpad_up = down(GLFW_GAMEPAD_BUTTON_DPAD_UP);
    pad.dpad_down = down(GLFW_GAMEPAD_BUTTON_DPAD_DOWN);
    return pad;
  }
  return pad;
}

PadPresses PadWatch::update(const GamePad& pad) {
  constexpr float kOver = 0.5f;
  PadPresses now;
  if (pad.present) {
    now.left = pad.dpad_left || pad.left_x < -kOver;
    now.right = pad.dpad_right || pad.left_x > kOver;
    now.up = pad.dpad_up || pad.left_y < -kOver;
    now.down = pad.dpad_down || pad.left_y > kOver;
    now.accept = pad.a;
    now.cancel = pad.b;
    now.next = pad.back;
    now.pause = pad.start;
    now.help = pad.y;
  }
  PadPresses pressed = now;
  for (bool PadPresses::*key :
       {&PadPresses::left, &PadPresses::right, &PadPresses::up, &PadPresses::down, &PadPresses::accept,
        &PadPresses::cancel, &PadPresses::next, &PadPresses::pause, &PadPresses::help})
    pressed.*key = now.*key && !(held_.*key);
  held_ = now;
  return pressed;
}

namespace {

// "Left Right Up Down, A D W S": the first keys of the four, then the second.
std::string move_keys(const KeyBindings& keys) {
  std::string out;
  for (std::size_t i = 0;; ++i) {
    std::string line;
    for (const Action action : {Action::move_left, Action::move_right, Action::move_forward, Action::move_back})
      if (const auto& chords = keys.chords(action); i < chords.size())
        line += (line.empty() ? "" : " ") + key_chord_name(chords[i]);
    if (line.empty()) return out.empty() ? "none" : out;
    out += (out.empty() ? "" : ", ") + line;
  }
}

}  // namespace

std::vector<GameControlRow> game_control_rows(const GameInfo& info, const KeyBindings& keys) {
  std::vector<GameControlRow> rows;
  const auto add = [&](const std::string& does, const std::string& how, const char* gamepad) {
    if (!does.empty()) rows.push_back({does, how, gamepad});
  };
  add(info.move_does, move_keys(keys), "left stick, cross");
  add(info.fire_does, keys.chord_names(Action::initialise), "A, right trigger");
  add(info.act_does, keys.chord_names(Action::game_act), "B, left trigger");
  add(info.dial_does, keys.chord_names(Action::game_less) + " less, " + keys.chord_names(Action::game_more) + " more",
      "shoulder buttons");
  add("pause", keys.chord_names(Action::game_pause), "Start");
  add("games", keys.chord_names(Action::next_game), "Back");
  add("this page", keys.chord_names(Action::help), "Y");
  return rows;
}

}  // namespace parallax
