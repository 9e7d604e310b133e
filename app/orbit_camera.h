// The camera of the map view, and how the pointer moves it. Pure, no window.
//
// Frames: world with z up (the dominant plane is z = 0 once there is one), metres.
#pragma once

#include <optional>

#include "core/camera_model.h"
#include "core/se3.h"
#include "map/tracking_snapshot.h"

namespace parallax {

struct OrbitCamera {
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  double yaw = -2.2;    // where the eye is, radians about z from x
  double pitch = 0.6;   // above the horizon, radians
  double distance = 1;  // metres from the target
  bool turned = false;  // the user has chosen the direction

  RigidTransform camera_from_world() const;
  Eigen::Vector3d eye() const;
};

// A pinhole of 50 degrees across the picture's height.
CameraModel orbit_lens(int width, int height);

// The map in sight. The direction is kept when the user has chosen one; else it is from behind the keyframes, a little
// to the side.
OrbitCamera fit_to_map(const TrackingSnapshot& map, OrbitCamera camera);

// One poll of the pointer, in pixels of the view from its top left.
struct PointerInput {
  double x = 0, y = 0;
  double scroll = 0;  // steps; up comes nearer
  bool left = false, middle = false, right = false;
  bool shift = false;  // the left button pans
};

// Left drag turns, middle or right drag (or shift and left) pans so that the target stays under the pointer, the wheel
// zooms. A left press and release in one place is a click.
class OrbitControl {
 public:
  OrbitCamera camera;

  // Call with every poll while the pointer belongs to the view; `height` of the view in pixels.
  // Returns where was clicked.
  std::optional<Eigen::Vector2d> update(const PointerInput& pointer, int height);
  // The pointer left the view, or a panel took it: a drag ends.
  void release();

 private:
  enum class Drag { none, turn, pan };
  Drag drag_ = Drag::none;
  bool was_left_ = false;
  Eigen::Vector2d last_ = Eigen::Vector2d::Zero(), pressed_at_ = Eigen::Vector2d::Zero();
  double travelled_px_ = 0;
};

}  // namespace parallax
