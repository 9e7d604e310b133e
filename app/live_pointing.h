// What the pointer does in the AR view: places, selects, moves and removes what the user has put on the map, and picks
// the points of a measurement. Belongs to the window's thread.
//
// Pixels: of the camera's image, level 0. World: of the frame's map.
#pragma once

#include <optional>
#include <string>

#include "app/live_session.h"
#include "app/live_state.h"
#include "core/camera_model.h"
#include "map/hit_test.h"

namespace parallax {

class LivePointing {
 public:
  // What is under the pixel, or on the optical axis where there is none; nothing when the frame has no pose.
  static std::optional<Hit> hit(const CameraModel& lens, const LiveFrame& frame,
                                const std::optional<Eigen::Vector2d>& pixel);
  // The item drawn nearest to the pixel, within reach.
  static std::optional<int> item_at(const CameraModel& lens, const LiveFrame& frame, const Content& content,
                                    const Eigen::Vector2d& pixel);

  // Each tells the user, through a toast, when it cannot be done.
  void place_label(const CameraModel& lens, const LiveFrame& frame, const std::optional<Eigen::Vector2d>& pixel,
                   LiveState* state);
  void place_model(const CameraModel& lens, const LiveFrame& frame, const std::optional<Eigen::Vector2d>& pixel,
                   LiveState* state);
  void erase(const CameraModel& lens, const LiveFrame& frame, const std::optional<Eigen::Vector2d>& pixel,
             LiveState* state);

  // Once a drawn frame, with the pointer over the picture (nothing: elsewhere, or over a panel). True while a drag
  // belongs to an item or a click to a measurement: the pointer is not free to turn the synthetic camera then.
  bool update(const CameraModel& lens, const LiveFrame& frame, const std::optional<Eigen::Vector2d>& pixel,
              bool left_button, LiveState* state);

 private:
  bool was_down_ = false;
  std::optional<int> dragged_;
  int labels_ = 0, models_ = 0;
};

}  // namespace parallax
