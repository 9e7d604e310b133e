#include "app/live_pointing.h"

#include <algorithm>
#include <cstring>

#include "app/content_drawing.h"
#include "app/model_catalogue.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kReach_px = 22;
constexpr const char* kNoPlace = "nothing to put it on there: point at the table or at a mapped point";
constexpr const char* kNotTracking = "not tracking: there is nowhere to put it yet";

std::optional<Vector2d> on_screen(const CameraModel& lens, const RigidTransform& camera_from_world,
                                  const Vector3d& at) {
  Vector2d pixel;
  if (!lens.project(camera_from_world * at, &pixel)) return std::nullopt;
  return pixel;
}

}  // namespace

std::optional<Hit> LivePointing::hit(const CameraModel& lens, const LiveFrame& frame,
                                     const std::optional<Vector2d>& pixel) {
  if (!frame.tracked.camera_from_world || !frame.map) return std::nullopt;
  const RigidTransform& pose = *frame.tracked.camera_from_world;
  Vector2d where;
  if (pixel) {
    where = *pixel;
  } else if (!lens.project(Vector3d::UnitZ(), &where)) {
    return std::nullopt;
  }
  return hit_test(lens, pose, where, *frame.map);
}

std::optional<int> LivePointing::item_at(const CameraModel& lens, const LiveFrame& frame, const Content& content,
                                         const Vector2d& pixel) {
  if (!frame.tracked.camera_from_world) return std::nullopt;
  std::optional<int> nearest;
  double best = kReach_px;
  for (const ContentItem& item : content.items()) {
    const Vector3d places[] = {
        item.position(), item.kind == ContentKind::label ? label_anchor(item) : item.position(),
        item.world_from_item * Vector3d(0, 0, item.kind == ContentKind::model ? item.size_m / 2 : 0)};
    for (const Vector3d& place : places) {
      const auto at = on_screen(lens, *frame.tracked.camera_from_world, place);
      if (!at || (*at - pixel).norm() >= best) continue;
      best = (*at - pixel).norm();
      nearest = item.id;
    }
  }
  return nearest;
}

void LivePointing::place_label(const CameraModel& lens, const LiveFrame& frame, const std::optional<Vector2d>& pixel,
                               LiveState* state) {
  if (!frame.tracked.camera_from_world) return state->toasts.add(kNotTracking, true);
  const auto place = hit(lens, frame, pixel);
  if (!place) return state->toasts.add(kNoPlace, true);
  const std::string text = "label " + std::to_string(++labels_);
  state->editing = state->content.add_label(text, place->position, place->normal);
  state->selected = state->editing;
  state->text = {};
  std::strncpy(state->text.data(), text.c_str(), state->text.size() - 1);
  state->task = Task::write_label;
  state->focus_text = true;
}

void LivePointing::place_model(const CameraModel& lens, const LiveFrame& frame, const std::optional<Vector2d>& pixel,
                               LiveState* state) {
  if (!frame.tracked.camera_from_world) return state->toasts.add(kNotTracking, true);
  const auto place = hit(lens, frame, pixel);
  if (!place) return state->toasts.add(kNoPlace, true);
  const auto& names = model_names();
  const std::string& name = names[static_cast<std::size_t>(models_++) % names.size()];
  // The side that faces the camera now stays the front.
  const Vector3d forward = frame.tracked.camera_from_world->inverse().R.col(0);
  const double size_m = 0.12 * place->distance_m;
  state->selected = state->content.add_model(name, frame_on_surface(place->position, place->normal, forward), size_m);
}

void LivePointing::erase(const CameraModel& lens, const LiveFrame& frame, const std::optional<Vector2d>& pixel,
                         LiveState* state) {
  const auto under = pixel ? item_at(lens, frame, state->content, *pixel) : std::nullopt;
  const auto item = under ? under : state->selected;
  if (!item || !state->content.erase(*item)) return state->toasts.add("point at a label or model to remove it", true);
  state->selected.reset();
}

bool LivePointing::update(const CameraModel& lens, const LiveFrame& frame, const std::optional<Vector2d>& pixel,
                          bool left_button, LiveState* state) {
  const bool pressed = left_button && !was_down_ && pixel;
  was_down_ = left_button;
  if (!left_button) dragged_.reset();
  if (state->task == Task::measure_first || state->task == Task::measure_second) {
    if (!pressed) return true;
    const auto place = hit(lens, frame, pixel);
    if (!place) {
      state->toasts.add("no mapped place there: click on the table or on a point", true);
      return true;
    }
    state->measured.push_back(place->position);
    const bool second = state->task == Task::measure_second;
    state->task = second ? Task::measure_distance : Task::measure_second;
    state->focus_text = second;
    if (second) state->text = {'1', '0'};
    return true;
  }
  if (pressed) {
    dragged_ = item_at(lens, frame, state->content, *pixel);
    state->selected = dragged_;
  }
  if (dragged_ && pixel && !pressed) {
    const auto place = hit(lens, frame, pixel);
    const ContentItem* item = state->content.find(*dragged_);
    if (place && item != nullptr) state->content.move(*dragged_, place->position);
  }
  return dragged_.has_value();
}

}  // namespace parallax
