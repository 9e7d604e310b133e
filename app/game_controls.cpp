#include "app/game_controls.h"

#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>

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

}  // namespace parallax
