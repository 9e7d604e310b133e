#include "app/view_memory.h"

#include <limits>

namespace parallax {
namespace {

// Turning by this angle changes the view as much as moving by the scene's depth.
constexpr double kAngleWorthADepth = 1.0;

}  // namespace

void ViewMemory::update(const TrackingResult& tracked) {
  if (tracked.state == TrackingState::trailing || tracked.state == TrackingState::initialising) {
    if (!tracked.message.empty()) {
      message_ = tracked.message;
      message_time_ = tracked.time;
    }
  } else {
    message_.clear();
  }
  const double age_s = std::chrono::duration<double>(tracked.time - message_time_).count();
  if (age_s > kMessage_s || age_s < 0) message_.clear();
  if (tracked.camera_from_world) {
    pose_ = tracked.camera_from_world;
    map_version_ = tracked.map_version;
    world_ = tracked.stamp();
    seen_from_ = tracked.seen_from;
  }
}

std::optional<RigidTransform> ViewMemory::last_pose(const TrackingSnapshot& map) const {
  if (!pose_ || map.map_version != map_version_) return std::nullopt;
  return map.world().rebase(world_, *pose_, seen_from_);
}

const SnapshotKeyframe* nearest_keyframe(const TrackingSnapshot& map, const RigidTransform& camera_from_world) {
  const Eigen::Vector3d centre = camera_from_world.inverse().t;
  const SnapshotKeyframe* best = nullptr;
  double best_distance = std::numeric_limits<double>::max();
  for (const SnapshotKeyframe& kf : map.keyframes) {
    const double moved = (kf.centre - centre).norm() / std::max(kf.mean_depth, 1e-6);
    const double turned = log_so3(kf.camera_from_world.R * camera_from_world.R.transpose()).norm();
    const double distance = moved + turned / kAngleWorthADepth;
    if (distance < best_distance) {
      best_distance = distance;
      best = &kf;
    }
  }
  return best;
}

GreyImage keyframe_picture(const SnapshotKeyframe& keyframe) {
  return keyframe.images ? keyframe.images->pyramid.level[1] : GreyImage();
}

}  // namespace parallax
