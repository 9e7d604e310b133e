// What the user does in the live window: keys and pointer.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <utility>

#include "app/live_window.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// The synthetic camera: speed of the keys, how far a drag across the picture turns, how far a step of the wheel goes.
constexpr double kHandSpeed = 0.12, kTurnOfPicture = 1.1, kWheelPush_m = 0.05;

}  // namespace

void LiveWindow::take_keys() {
  for (const KeyEvent& event : window_->poll()) {
    input_seen_ = true;
    const bool enter = event.key == GLFW_KEY_ENTER || event.key == GLFW_KEY_KP_ENTER;
    if (!event.pressed) {
      // While a text is typed its keys belong to the interface, which misses one that was let go of between two drawn
      // frames. The text ends once the interface has seen the letters before it.
      if (enter && !std::exchange(enter_acted_, false)) enter_seen_ = state_.typing();
      if (event.key == GLFW_KEY_ESCAPE && state_.typing()) drop_task();
      continue;
    }
    if (enter) enter_acted_ = true;
    if (state_.task == Task::none && maps_.takes(event.key, event.modifiers, &engine_, &state_)) continue;
    if (games_.menu_is_open() && menu_takes(event)) continue;
    if (const auto action = state_.settings.keys.action_of(event.key, event.modifiers)) {
      if (game_has_keys()) tapped_.push_back(*action);
      act(*action);
    }
  }
  take_pad();
  move_hand();
  pointer_ = window_->pointer();
  if (pointer_.x != last_pointer_.x || pointer_.y != last_pointer_.y || pointer_.scroll != 0 ||
      pointer_.left != last_pointer_.left || pointer_.middle != last_pointer_.middle ||
      pointer_.right != last_pointer_.right)
    input_seen_ = true;
  if (pointer_.scroll != 0) pending_scroll_ += pointer_.scroll;
}

void LiveWindow::act(Action action) {
  LivePanels& panels = state_.panels;
  const bool tracking_screen = state_.screen == Screen::augmented || state_.screen == Screen::map;
  const bool pointing = state_.screen == Screen::augmented && shown_ != nullptr;
  const CameraModel& lens = engine_.lens();
  switch (action) {
    case Action::initialise:
      // In a game on a map the key fires; held, in game_keys().
      if (!tracking_screen || engine_.session() == nullptr || game_has_keys()) break;
      if (shown_ && shown_->tracked.state == TrackingState::lost && engine_.maps() != nullptr) {
        engine_.maps()->begin_new_map();  // and presses the key on it
      } else {
        engine_.session()->press_initialise();
      }
      break;
    case Action::reset:
      state_.requests.reset = true;
      break;
    case Action::map_view:
      if (!tracking_screen) break;
      state_.screen = state_.screen == Screen::map ? Screen::augmented : Screen::map;
      orbit_.release();
      if (state_.screen == Screen::map && shown_ && shown_->map) {
        orbit_.camera = fit_to_map(*shown_->map, orbit_.camera);
        if (shown_->map->empty()) state_.toasts.add("there is no map yet");
      }
      break;
    case Action::next_game:
      next_game();
      break;
    case Action::game_pause:
      games_.toggle_pause();
      break;
    case Action::calibrate:
      state_.requests.calibrate = true;
      break;
    case Action::label:
      if (pointing) pointing_.place_label(lens, *shown_, cursor_px_, &state_);
      break;
    case Action::model:
      if (pointing) pointing_.place_model(lens, *shown_, cursor_px_, &state_);
      break;
    case Action::erase:
      if (pointing) pointing_.erase(lens, *shown_, cursor_px_, &state_);
      break;
    case Action::measure:
      state_.requests.measure = true;
      break;
    case Action::plane:
      state_.requests.find_plane = true;
      break;
    case Action::help:
      if (game_has_keys() && !panels.help) {
        games_.explain();
      } else {
        panels.help = !panels.help;
      }
      break;
    case Action::camera_panel:
      panels.camera = !panels.camera;
      break;
    case Action::map_panel:
      panels.map = !panels.map;
      break;
    case Action::content_panel:
      panels.content = !panels.content;
      break;
    case Action::record_panel:
      panels.record = !panels.record;
      break;
    case Action::debug_panel:
      panels.debug = !panels.debug;
      break;
    case Action::maps_panel:
      if (tracking_screen && engine_.session() != nullptr) state_.requests.maps = true;
      break;
    case Action::video:
      state_.requests.video = true;
      break;
    case Action::full_screen:
      window_->set_full_screen(!window_->geometry().full_screen);
      break;
    case Action::screenshot:
      state_.requests.screenshot = true;
      break;
    case Action::quit:
      // First out of what one is in the middle of.
      if (state_.task != Task::none) {
        drop_task();
      } else if (state_.screen == Screen::calibrating) {
        cancel_calibration();
      } else {
        window_->close();
      }
      break;
    case Action::game_act:
    case Action::game_more:
    case Action::game_less:
      break;  // while they are held: game_keys()
    case Action::move_left:
    case Action::move_right:
    case Action::move_up:
    case Action::move_down:
    case Action::move_forward:
    case Action::move_back:
      break;  // while they are held: move_hand()
  }
}

bool LiveWindow::is_held(Action action) const {
  if (ImGui::GetIO().WantTextInput) return false;
  const auto& chords = state_.settings.keys.chords(action);
  return std::any_of(chords.begin(), chords.end(), [&](const KeyChord& c) { return window_->key_down(c.key); });
}

// A game has the keys while it is seen and there is a map to play on; with Shift the synthetic camera has them.
bool LiveWindow::game_has_keys() const {
  return games_.playing() && !games_.menu_is_open() && state_.screen == Screen::augmented && shown_ && shown_->map &&
         !shown_->map->empty();
}

GameKeys LiveWindow::game_keys() const {
  GameKeys keys;
  if (!game_has_keys() || window_->key_down(GLFW_KEY_LEFT_SHIFT) || window_->key_down(GLFW_KEY_RIGHT_SHIFT))
    return keys;
  const auto is_down = [this](Action action) {
    return is_held(action) || std::find(tapped_.begin(), tapped_.end(), action) != tapped_.end();
  };
  keys.left = is_down(Action::move_left);
  keys.right = is_down(Action::move_right);
  keys.away = is_down(Action::move_forward);
  keys.near = is_down(Action::move_back);
  keys.fire = is_down(Action::initialise);
  keys.act = is_down(Action::game_act);
  keys.more = is_down(Action::game_more);
  keys.less = is_down(Action::game_less);
  return keys;
}

void LiveWindow::next_game() {
  if (engine_.session() == nullptr || (state_.screen != Screen::augmented && state_.screen != Screen::map)) return;
  if (state_.screen == Screen::map) act(Action::map_view);
  drop_task();
  games_.next();
}

// Arrows, Enter, Space and Escape are the menu's whatever they are bound to; so are the keys of what it has.
bool LiveWindow::menu_takes(const KeyEvent& event) {
  if (state_.screen != Screen::augmented) return false;
  static constexpr std::pair<int, MenuKey> kKeys[] = {
      {GLFW_KEY_LEFT, MenuKey::left},    {GLFW_KEY_RIGHT, MenuKey::right},  {GLFW_KEY_UP, MenuKey::up},
      {GLFW_KEY_DOWN, MenuKey::down},    {GLFW_KEY_ENTER, MenuKey::accept}, {GLFW_KEY_KP_ENTER, MenuKey::accept},
      {GLFW_KEY_SPACE, MenuKey::accept}, {GLFW_KEY_ESCAPE, MenuKey::back},  {GLFW_KEY_BACKSPACE, MenuKey::back},
      {GLFW_KEY_TAB, MenuKey::next}};
  if (event.modifiers == 0)
    for (const auto& [key, meaning] : kKeys)
      if (key == event.key) {
        press_in_menu(meaning);
        return true;
      }
  static constexpr std::pair<Action, MenuKey> kMeanings[] = {
      {Action::move_left, MenuKey::left}, {Action::move_right, MenuKey::right},  {Action::move_forward, MenuKey::up},
      {Action::move_back, MenuKey::down}, {Action::initialise, MenuKey::accept}, {Action::next_game, MenuKey::next},
      {Action::help, MenuKey::help},      {Action::game_pause, MenuKey::back}};
  const auto action = state_.settings.keys.action_of(event.key, event.modifiers);
  for (const auto& [meant, meaning] : kMeanings)
    if (action == meant) {
      press_in_menu(meaning);
      return true;
    }
  // What concerns the window goes on; what would change the picture behind the menu does not.
  return action != Action::screenshot && action != Action::video && action != Action::full_screen &&
         action != Action::debug_panel && action != Action::quit;
}

void LiveWindow::press_in_menu(MenuKey key) {
  try {
    games_.press(key, engine_.lens());
  } catch (const std::exception& e) {
    state_.toasts.add(e.what(), true);
  }
}

void LiveWindow::take_pad() {
  pad_ = engine_.session() != nullptr ? read_game_pad() : GamePad{};
  const PadPresses pressed = pad_watch_.update(pad_);
  if (state_.screen != Screen::augmented) return;
  if (!games_.menu_is_open()) {
    if (pressed.next) act(Action::next_game);
    if (pressed.pause) games_.toggle_pause();
    if (pressed.help && game_has_keys()) games_.explain();
    input_seen_ = input_seen_ || pressed.next || pressed.pause || pressed.help;
    return;
  }
  const std::pair<bool, MenuKey> keys[] = {
      {pressed.left, MenuKey::left},  {pressed.right, MenuKey::right},   {pressed.up, MenuKey::up},
      {pressed.down, MenuKey::down},  {pressed.accept, MenuKey::accept}, {pressed.cancel, MenuKey::back},
      {pressed.pause, MenuKey::back}, {pressed.next, MenuKey::next},     {pressed.help, MenuKey::help}};
  for (const auto& [is_pressed, key] : keys) {
    if (!is_pressed) continue;
    press_in_menu(key);
    input_seen_ = true;
  }
}

void LiveWindow::move_hand() {
  if (!engine_.is_open() || engine_.source().hand == nullptr) return;
  const bool shift = window_->key_down(GLFW_KEY_LEFT_SHIFT) || window_->key_down(GLFW_KEY_RIGHT_SHIFT);
  const bool free = (!game_has_keys() && !games_.menu_is_open()) || shift;
  const auto held = [&](Action action) {
    const bool sideways = action != Action::move_up && action != Action::move_down;
    return (free || !sideways) && is_held(action) ? 1.0 : 0.0;
  };
  engine_.source().hand->set_velocity(kHandSpeed * Vector3d(held(Action::move_right) - held(Action::move_left),
                                                            held(Action::move_up) - held(Action::move_down),
                                                            held(Action::move_forward) - held(Action::move_back)));
}

std::optional<Vector2d> LiveWindow::pixel_at(const Picture& picture, double pointer_x, double pointer_y) const {
  const Viewport& v = picture.viewport;
  if (v.width <= 0 || ImGui::GetIO().WantCaptureMouse) return std::nullopt;
  const int top = window_->framebuffer_height() - v.y - v.height;
  const double x = pointer_x - v.x, y = pointer_y - top;
  if (x < 0 || y < 0 || x >= v.width || y >= v.height) return std::nullopt;
  const CameraModel& lens = engine_.lens();
  return Vector2d((x + 0.5) * lens.width() / v.width - 0.5, (y + 0.5) * lens.height() / v.height - 0.5);
}

void LiveWindow::take_pointer(const Picture& picture) {
  // Buttons as the interface sees them: pressed and let go between two drawn frames still counts.
  PointerState pointer = pointer_;
  const ImGuiIO& io = ImGui::GetIO();
  pointer.left = io.MouseDown[ImGuiMouseButton_Left];
  pointer.right = io.MouseDown[ImGuiMouseButton_Right];
  pointer.middle = io.MouseDown[ImGuiMouseButton_Middle];
  pointer.scroll = pending_scroll_;
  pending_scroll_ = 0;
  const bool was_down = last_pointer_.left;
  // Of a press, where it was made: the pointer may have gone on before this frame is drawn.
  const bool pressed = pointer.left && !was_down && !ImGui::GetIO().WantCaptureMouse;
  const double dx = pointer.x - (pressed ? pointer.pressed_x : last_pointer_.x);
  const double dy = pointer.y - (pressed ? pointer.pressed_y : last_pointer_.y);
  last_pointer_ = pointer;
  const bool on_panel = ImGui::GetIO().WantCaptureMouse;
  cursor_px_ = pixel_at(picture, pointer.x, pointer.y);
  if (state_.screen == Screen::map) {
    if (on_panel) return orbit_.release();
    const int width = window_->framebuffer_width(), height = window_->framebuffer_height();
    const auto click = orbit_.update(
        {pointer.x, pointer.y, pointer.scroll, pointer.left, pointer.middle, pointer.right, ImGui::GetIO().KeyShift},
        height);
    if (click && shown_ && shown_->map) {
      const CameraModel& lens = engine_.lens();
      selected_keyframe_ =
          pick_keyframe({shown_->map.get(), &shown_->tracked, &lens, &path_, &state_.content, selected_keyframe_},
                        orbit_.camera, width, height, *click);
    }
    return;
  }
  if (state_.screen != Screen::augmented || !shown_) return;
  const auto pointed = pressed ? pixel_at(picture, pointer.pressed_x, pointer.pressed_y) : cursor_px_;
  const bool taken = pointing_.update(engine_.lens(), *shown_, pointed, pointer.left && !on_panel, &state_);
  HandControl* hand = engine_.is_open() ? engine_.source().hand : nullptr;
  if (hand == nullptr || on_panel) {
    turning_ = false;
    return;
  }
  if (pointer.scroll != 0) hand->push(kWheelPush_m * pointer.scroll);
  if (pressed) turning_ = !taken && pointed.has_value();
  if (!pointer.left) turning_ = false;
  if (!turning_) return;
  // The scene follows the pointer, as if it were pushed.
  const double per_px = kTurnOfPicture / std::max(1, picture.viewport.width);
  hand->turn(dx * per_px, dy * per_px);
}

}  // namespace parallax
