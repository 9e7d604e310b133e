#include "app/orbit_camera.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace parallax {
namespace {

constexpr double kHalfHeight = 0.46630765815499859;  // tan(25 degrees)
constexpr double kTurn_rad = M_PI;                   // for a drag over the height of the view
constexpr double kZoomStep = 0.88;                   // of the distance, a step of the wheel
constexpr double kNearest_m = 0.02, kFurthest_m = 500;
constexpr double kSteepest_rad = 1.55;  // straight down has no yaw
constexpr double kClick_px = 4;         // a press that moves further is a drag
// What is fitted in sight: this share of the points, so that one stray does not decide.
constexpr double kFitShare = 0.8;
constexpr double kFitMargin = 1.1;
constexpr double kAside_rad = 0.5, kAbove_rad = 0.6;  // of the first look

double middle_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The way the keyframes look, level with the ground: where a camera looks down, that is the way of its upper edge.
Eigen::Vector2d level_direction(const TrackingSnapshot& map) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const auto& kf : map.keyframes)
    sum += (kf.camera_from_world.R.row(2) - kf.camera_from_world.R.row(1)).transpose().head<2>();
  return sum;
}

}  // namespace

Eigen::Vector3d OrbitCamera::eye() const {
  return target +
         distance * Eigen::Vector3d(std::cos(pitch) * std::cos(yaw), std::cos(pitch) * std::sin(yaw), std::sin(pitch));
}

RigidTransform OrbitCamera::camera_from_world() const {
  const Eigen::Vector3d forward = (target - eye()).normalized();
  const Eigen::Vector3d right(-std::sin(yaw), std::cos(yaw), 0);
  RigidTransform out;
  out.R.row(0) = right;
  out.R.row(1) = forward.cross(right);
  out.R.row(2) = forward;
  out.t = -(out.R * eye());
  return out;
}

CameraModel orbit_lens(int width, int height) {
  const double focal = 0.5 * height / kHalfHeight;
  return {CameraModelKind::pinhole, width, height, {focal, focal}, {0.5 * (width - 1), 0.5 * (height - 1)}};
}

OrbitCamera fit_to_map(const TrackingSnapshot& map, OrbitCamera camera) {
  if (map.empty()) return camera;
  std::vector<Eigen::Vector3d> places = map.position;
  for (const auto& kf : map.keyframes) places.push_back(kf.centre);
  Eigen::Vector3d centre;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const auto& p : places) values.push_back(p[axis]);
    centre[axis] = middle_of(std::move(values));
  }
  std::vector<double> distances;
  for (const auto& p : places) distances.push_back((p - centre).norm());
  const auto share = static_cast<std::size_t>(kFitShare * static_cast<double>(distances.size() - 1));
  std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(share), distances.end());
  double radius = distances[share];
  for (const auto& kf : map.keyframes) radius = std::max(radius, (kf.centre - centre).norm());
  camera.target = centre;
  const Eigen::Vector2d ahead = level_direction(map);
  if (!camera.turned && ahead.norm() > 0) {
    camera.yaw = std::remainder(std::atan2(-ahead.y(), -ahead.x()) + kAside_rad, 2 * M_PI);
    camera.pitch = kAbove_rad;
  }
  const double sine = kHalfHeight / std::sqrt(1 + kHalfHeight * kHalfHeight);
  camera.distance = std::clamp(kFitMargin * radius / sine, kNearest_m, kFurthest_m);
  return camera;
}

void OrbitControl::release() {
  drag_ = Drag::none;
  was_left_ = false;
}

std::optional<Eigen::Vector2d> OrbitControl::update(const PointerInput& pointer, int height) {
  const Eigen::Vector2d at(pointer.x, pointer.y);
  std::optional<Eigen::Vector2d> click;
  if (pointer.scroll != 0)
    camera.distance = std::clamp(camera.distance * std::pow(kZoomStep, pointer.scroll), kNearest_m, kFurthest_m);

  const bool pan = pointer.middle || pointer.right || (pointer.left && pointer.shift);
  const Drag wanted = pan ? Drag::pan : pointer.left ? Drag::turn : Drag::none;
  if (drag_ != Drag::none && wanted == drag_ && height > 0) {
    const Eigen::Vector2d moved = at - last_;
    travelled_px_ = std::max(travelled_px_, (at - pressed_at_).norm());
    if (drag_ == Drag::turn) {
      camera.turned = camera.turned || moved.norm() > 0;
      camera.yaw = std::remainder(camera.yaw - kTurn_rad * moved.x() / height, 2 * M_PI);
      camera.pitch = std::clamp(camera.pitch + kTurn_rad * moved.y() / height, -kSteepest_rad, kSteepest_rad);
    } else {
      const double metres_a_px = camera.distance * 2 * kHalfHeight / height;
      const RigidTransform view = camera.camera_from_world();
      camera.target -= metres_a_px * (view.R.transpose() * Eigen::Vector3d(moved.x(), moved.y(), 0));
    }
  }
  if (wanted != drag_) {
    if (drag_ == Drag::turn && wanted == Drag::none && was_left_ && travelled_px_ <= kClick_px) click = pressed_at_;
    pressed_at_ = at;
    travelled_px_ = 0;
    drag_ = wanted;
  }
  was_left_ = pointer.left;
  last_ = at;
  return click;
}

}  // namespace parallax
