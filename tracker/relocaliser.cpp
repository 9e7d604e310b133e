#include "tracker/relocaliser.h"

#include <algorithm>
#include <numeric>

#include "solver/absolute_pose.h"
#include "tracker/tracking_quality.h"

namespace parallax {
namespace {

constexpr double kRecoveryCoarseRadius_px = 45;
// A candidate pose is looked at with so many points first. Where fewer than this part support it, no more are asked.
constexpr int kFirstLookPoints = 120;
constexpr double kFirstLookPart = 0.15;
// A candidate's small image must be explained to this part of its own variance after alignment.
constexpr double kMaxUnexplained = 0.9;

double variance(const SmallBlurryImage& image) {
  double sum = 0;
  for (float v : image.image) sum += static_cast<double>(v) * v;
  return sum / std::max<double>(1.0, static_cast<double>(image.image.total()));
}

// Keyframes whose points are described in one frame, so that a frame's time stays bounded.
constexpr int kDescribedKeyframes = 6;
// Matches that must agree with a pose by descriptors for it to be looked at; that they do not by chance is asked apart.
constexpr int kMinAgreeing = 9;

struct Scored {
  double difference;
  int row;
};

}  // namespace

bool Relocaliser::try_pose(const TrackingSnapshot& map, const FrameImages& frame, const RigidTransform& pose,
                           bool is_guess, TwoStageTracker* tracker, TwoStageResult* result) {
  TwoStageRequest request;
  request.prior = pose;
  request.coarse_radius_px = kRecoveryCoarseRadius_px;
  request.fine_radius_px = options_.fine_radius_no_coarse_px;
  request.needs_coarse = is_guess;
  request.first_look_points = kFirstLookPoints;
  tracker->track(map, frame, request, result);
  const int asked = std::accumulate(result->attempted.begin(), result->attempted.end(), 0);
  if (!result->ok || result->inliers < std::max<double>(options_.coarse_min, kFirstLookPart * asked)) return false;
  // A second pass from the pose found: what is right stays right and finds more.
  looked_closely_ = true;
  request.prior = result->camera_from_world;
  request.coarse = request.needs_coarse = false;
  request.first_look_points = 0;
  request.fine_radius_px = options_.fine_radius_px;
  tracker->track(map, frame, request, result);
  return accept_recovery(*result, camera_, options_);
}

bool Relocaliser::recover_by_descriptors(const TrackingSnapshot& map, const FrameImages& frame,
                                         TwoStageTracker* tracker, TwoStageResult* accepted) {
  matcher_.prepare(map, kDescribedKeyframes);
  std::vector<double> turns;
  const std::vector<PoseObservation> matches = matcher_.match(map, frame, &turns);
  RigidTransform pose;
  AbsolutePoseOptions pose_options;
  pose_options.best_first = true;
  pose_options.turns = turns;
  pose_options.min_inliers = kMinAgreeing;
  if (!solve_absolute_pose(camera_, matches, pose_options, &rng_, &pose).ok) return false;
  return try_pose(map, frame, pose, false, tracker, accepted);
}

bool Relocaliser::recover(const TrackingSnapshot& map, const FrameImages& frame, const RigidTransform& hint,
                          TwoStageTracker* tracker, TwoStageResult* accepted) {
  if (map.keyframes.empty()) return false;
  looked_closely_ = false;
  if (try_pose(map, frame, hint, true, tracker, accepted)) return true;

  std::vector<Scored> scored;
  for (std::size_t i = 0; i < map.keyframes.size(); ++i)
    scored.push_back({small_image_difference(map.keyframes[i].images->small, frame.small), static_cast<int>(i)});
  std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
    return a.difference != b.difference ? a.difference < b.difference : a.row < b.row;
  });

  const double frame_variance = variance(frame.small);
  // The best one is tried in every frame, the others take turns.
  std::vector<int> rows = {scored.front().row};
  const std::size_t others = scored.size() - 1;
  for (int k = 1; k < options_.recovery_candidates && others > 0; ++k) rows.push_back(scored[1 + next_++ % others].row);
  for (int row : rows) {
    if (looked_closely_) break;  // once in a frame: one more guess that leads nowhere takes as long as all descriptors
    const SnapshotKeyframe& kf = map.keyframes[row];
    const SmallImageAlignment alignment = align_small_images(kf.images->small, frame.small);
    if (!alignment.converged || alignment.mean_squared_difference > kMaxUnexplained * frame_variance) continue;
    // The image motion is read as a rotation; for the most alike then as a sideways translation at the keyframe's
    // depth.
    const Eigen::Matrix3d rotation = rotation_from_alignment(camera_, alignment);
    const RigidTransform rotated(rotation * kf.camera_from_world.R, rotation * kf.camera_from_world.t);
    if (try_pose(map, frame, rotated, true, tracker, accepted)) return true;
    if (row != rows.front() || looked_closely_) continue;
    RigidTransform shifted = kf.camera_from_world;
    shifted.t.head<2>() += (alignment.shift.array() / camera_.focal_px().array() * kf.mean_depth).matrix();
    if (try_pose(map, frame, shifted, true, tracker, accepted)) return true;
  }
  return recover_by_descriptors(map, frame, tracker, accepted);
}

}  // namespace parallax
