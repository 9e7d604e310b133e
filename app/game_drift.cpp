#include "app/game_drift.h"

#include <algorithm>
#include <map>

#include "core/error.h"
#include "core/trajectory_error.h"

namespace parallax {
namespace {

constexpr double kSameTime_s = 0.005;

}  // namespace

std::optional<GameDrift> measure_drift(const std::vector<GameSight>& sights, const std::vector<StampedPose>& truth,
                                       const CameraModel& camera) {
  Trajectory seen, exact;
  for (const GameSight& sight : sights) seen.push_back({sight.time, sight.camera_from_world.inverse()});
  for (const StampedPose& pose : truth) exact.push_back({pose.time, pose.world_from_camera});
  if (seen.size() < 3 || exact.size() < 3) return std::nullopt;
  const std::vector<PoseMatch> matches = associate_by_time(seen, exact, kSameTime_s);
  double scale = 1;  // true metres for each of the map's
  try {
    scale = find_alignment(seen, exact, matches, Alignment::sim3).s;
  } catch (const InputError&) {
    return std::nullopt;
  }
  std::map<std::uint64_t, Eigen::Vector3d> put_down;  // the true place of every thing
  std::vector<double> errors;
  for (const PoseMatch& match : matches) {
    const GameSight& sight = sights[static_cast<std::size_t>(match.estimate)];
    const RigidTransform& true_pose = exact[static_cast<std::size_t>(match.truth)].world_from_camera;
    const Eigen::Vector3d in_camera = sight.camera_from_world * sight.place;
    Eigen::Vector2d drawn, expected;
    const bool visible = camera.project(in_camera, &drawn) && camera.in_image(drawn);
    const auto known = put_down.find(sight.number);
    if (known == put_down.end()) {
      if (visible) put_down.emplace(sight.number, true_pose * (scale * in_camera));
      continue;
    }
    if (!camera.project(true_pose.inverse() * known->second, &expected)) continue;
    if (!camera.in_image(expected) && !visible) continue;
    if (!camera.project(in_camera, &drawn)) continue;
    errors.push_back((drawn - expected).norm());
  }
  if (errors.empty()) return std::nullopt;
  GameDrift out;
  out.frames = static_cast<int>(errors.size());
  out.things = static_cast<int>(put_down.size());
  const ErrorStatistics statistics = summarise_errors(errors);
  out.median_px = statistics.median;
  out.largest_px = statistics.max;
  return out;
}

}  // namespace parallax
