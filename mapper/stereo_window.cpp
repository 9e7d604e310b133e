#include "mapper/stereo_window.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "core/time.h"
#include "solver/stereo_pose.h"

namespace parallax {
namespace {

constexpr double kFarthest_px = 1.0;  // disparity of what is still placed on the feature map
constexpr double kFitsWithin_sigmas = 3;
constexpr int kPosesOnMap = 3;  // that saw it

Eigen::Vector4d moved(const RigidTransform& b_from_a, const Eigen::Vector4d& point) {
  Eigen::Vector4d out;
  out << b_from_a.R * point.head<3>() + b_from_a.t * point.w(), point.w();
  return out.normalized();
}

void require(bool ok, const char* key, double found, const char* expected) {
  if (ok) return;
  throw InputError("window option " + std::string(key) + ": found " + std::to_string(found) + ", expected " + expected);
}

}  // namespace

void StereoWindowOptions::validate() const {
  require(poses >= 2 && poses <= 100, "poses", poses, "2 to 100");
  require(kept_poses >= 1 && kept_poses < poses, "kept_poses", kept_poses, "1 to below poses");
  require(min_poses_per_point >= 1, "min_poses_per_point", min_poses_per_point, "1 or more");
  require(sigma_px > 0, "sigma_px", sigma_px, "above 0");
  require(noise_part > 0, "noise_part", noise_part, "above 0");
}

StereoWindow::StereoWindow(const StereoCamera& camera, const StereoWindowOptions& options)
    : camera_(camera), options_(options) {
  options_.validate();
}

StereoWindowUpdate StereoWindow::add(const StereoKeyframe& keyframe, const Interruption& stop) {
  PARALLAX_CHECK(keyframe.index == static_cast<int>(poses_.size()), "a keyframe out of turn");
  if (static_cast<int>(window_.size()) >= options_.poses || (keyframe.after_failure && !window_.empty()))
    hand_over(keyframe.after_failure ? 1 : options_.kept_poses);
  const RigidTransform before = poses_.empty() ? RigidTransform() : poses_.back().world_from_camera;
  poses_.push_back({keyframe.frame, keyframe.time, before * keyframe.previous_from_this});
  poses_.back().world_from_camera.orthonormalise();
  if (keyframe.after_failure) {
    // Nothing that was seen before is seen again: the window begins with this pose.
    StereoConstraint constraint;
    constraint.from = keyframe.index - 1;
    constraint.to = keyframe.index;
    constraint.from_from_to = keyframe.previous_from_this;
    constraint.covariance = keyframe.covariance;
    constraint.after_failure = true;
    constraints_.push_back(constraint);
    handed_over_ = keyframe.index;
    for (const auto& [track, point] : points_)
      if (const auto placed = place(point)) left_points_.push_back(*placed);
    window_.clear();
    points_.clear();
  }
  Pose pose;
  pose.index = keyframe.index;
  pose.covariance = keyframe.covariance;
  for (const StereoMeasurement& m : keyframe.measurements) {
    pose.observations.push_back({m.track, m.pixel});
    Point& point = points_[m.track];
    if (point.seen == 0) point.world = moved(poses_.back().world_from_camera, m.point);
    ++point.poses;
    ++point.seen;
  }
  window_.push_back(std::move(pose));

  StereoWindowTiming timing;
  timing.keyframe = keyframe.index;
  StereoWindowUpdate update;
  update.keyframe = keyframe.index;
  smooth(&timing, &update, stop);
  update.world_from_keyframe = poses_.back().world_from_camera;
  timings_.push_back(timing);
  return update;
}

// In the frame of the window's first pose, which is held.
WindowProblem StereoWindow::make_problem(std::vector<std::int64_t>* tracks,
                                         std::vector<std::pair<int, int>>* source) const {
  WindowProblem problem;
  problem.camera = camera_;
  const RigidTransform origin_from_world = pose_of(window_.front()).inverse();
  for (const Pose& pose : window_) {
    problem.poses.push_back((origin_from_world * pose_of(pose)).inverse());
    problem.pose_fixed.push_back(problem.poses.size() == 1);
  }
  std::map<std::int64_t, int> row;
  for (const auto& [track, point] : points_) {
    if (point.poses < options_.min_poses_per_point) continue;
    row[track] = static_cast<int>(tracks->size());
    tracks->push_back(track);
    problem.points.push_back(moved(origin_from_world, point.world));
  }
  for (std::size_t p = 0; p < window_.size(); ++p) {
    const auto& observations = window_[p].observations;
    for (std::size_t k = 0; k < observations.size(); ++k) {
      const auto found = row.find(observations[k].track);
      if (found == row.end()) continue;
      problem.observations.push_back({static_cast<int>(p), found->second, observations[k].pixel, options_.sigma_px});
      source->emplace_back(static_cast<int>(p), static_cast<int>(k));
    }
  }
  return problem;
}

// A newest pose that was told wrongly fits nothing, and the kernel would let go of it as a whole: it is placed by the
// points that are known already.
void StereoWindow::place_newest() {
  RigidTransform& newest = pose_of(window_.back());
  const RigidTransform previous = pose_of(window_[window_.size() - 2]), previous_from_world = previous.inverse();
  RigidTransform newest_from_previous = newest.inverse() * previous;
  std::vector<StereoPoseObservation> seen;
  std::size_t wrong = 0;
  for (const Observation& o : window_.back().observations) {
    const Point& point = points_[o.track];
    if (point.seen < 2) continue;  // by this pose alone
    seen.push_back({moved(previous_from_world, point.world), 0, o.pixel, options_.sigma_px});
    const Eigen::Vector4d here = moved(newest_from_previous, seen.back().point);
    const Eigen::Vector2d pixel =
        camera_.centre_px + camera_.focal_px.cwiseProduct(here.head<2>() / std::max(1e-9, here.z()));
    wrong += static_cast<std::size_t>((pixel - Eigen::Vector2d(o.pixel.x(), o.pixel.z())).norm() >
                                      kFitsWithin_sigmas * options_.sigma_px);
  }
  if (2 * wrong <= seen.size()) return;
  // Refined from where it was told it may end in a wrong minimum; three points need no start.
  std::mt19937_64 rng(static_cast<std::uint64_t>(window_.back().index));
  const RigidTransform told[] = {newest_from_previous};
  std::vector<std::uint8_t> agrees;
  if (find_stereo_pose(camera_, seen, told, {}, &rng, &newest_from_previous, &agrees).ok &&
      refine_stereo_pose(camera_, seen, {}, &newest_from_previous, nullptr).ok)
    newest = previous * newest_from_previous.inverse();
}

void StereoWindow::smooth(StereoWindowTiming* timing, StereoWindowUpdate* update, const Interruption& stop) {
  if (window_.size() < 2) return;
  const auto begin = SteadyClock::now();
  const RigidTransform told = pose_of(window_.back());
  place_newest();
  std::vector<std::int64_t> tracks;
  std::vector<std::pair<int, int>> source;
  WindowProblem problem = make_problem(&tracks, &source);
  std::vector<std::uint8_t> outlier;
  const WindowSummary summary = smooth_window(&problem, options_.solver, stop, &outlier);
  timing->poses = static_cast<int>(window_.size());
  timing->points = static_cast<int>(tracks.size());
  timing->observations = static_cast<int>(problem.observations.size());
  timing->iterations = summary.iterations;
  timing->sigma = summary.sigma;
  if (summary.failed) {
    timing->smoothing_ms = milliseconds_since(begin);
    return;
  }
  const RigidTransform world_from_origin = pose_of(window_.front());
  for (std::size_t p = 1; p < window_.size(); ++p) {
    RigidTransform& pose = pose_of(window_[p]);
    pose = world_from_origin * problem.poses[p].inverse();
    pose.orthonormalise();
  }
  for (std::size_t i = 0; i < tracks.size(); ++i)
    points_[tracks[i]].world = moved(world_from_origin, problem.points[i]);
  // What the newest pose alone has seen goes where it has gone.
  const RigidTransform now_from_told = pose_of(window_.back()) * told.inverse();
  for (const Observation& o : window_.back().observations) {
    Point& point = points_[o.track];
    if (point.seen == 1) point.world = moved(now_from_told, point.world);
  }
  // What does not fit is forgotten; a track that no longer fits where it was seen last is not worth following.
  std::set<std::int64_t> gone;
  std::vector<std::vector<int>> wrong(window_.size());
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    if (!outlier[i]) continue;
    const auto [p, k] = source[i];
    wrong[static_cast<std::size_t>(p)].push_back(k);
    const std::int64_t track = window_[static_cast<std::size_t>(p)].observations[static_cast<std::size_t>(k)].track;
    if (static_cast<std::size_t>(p) + 1 == window_.size()) gone.insert(track);
    --points_[track].poses;
  }
  for (std::size_t p = 0; p < window_.size(); ++p) {
    auto& observations = window_[p].observations;
    for (auto k = wrong[p].rbegin(); k != wrong[p].rend(); ++k) observations.erase(observations.begin() + *k);
  }
  // To the tracker: all that the newest pose sees.
  const RigidTransform newest_from_world = pose_of(window_.back()).inverse();
  for (const Observation& o : window_.back().observations) {
    const Point& point = points_[o.track];
    if (point.poses < options_.min_poses_per_point) continue;
    update->points.push_back({o.track, moved(newest_from_world, point.world), point.poses, false});
  }
  for (const std::int64_t track : gone) update->points.push_back({track, {0, 0, 1, 0}, 0, true});
  std::sort(update->points.begin(), update->points.end(),
            [](const auto& a, const auto& b) { return a.track < b.track; });
  timing->smoothing_ms = milliseconds_since(begin);
}

// Constraints of the window's poses become final; its last `kept` poses stay (MS §3.2).
void StereoWindow::hand_over(int kept) {
  ++windows_;
  const auto begin = SteadyClock::now();
  const int leave = std::max(0, static_cast<int>(window_.size()) - kept);
  // A pair is final when its later pose leaves, or is the first of those that stay.
  std::vector<std::pair<int, int>> pairs;
  for (int p = 1; p < static_cast<int>(window_.size()) && p <= leave; ++p)
    if (window_[static_cast<std::size_t>(p)].index > handed_over_) pairs.emplace_back(p, p - 1);
  if (!pairs.empty()) {
    std::vector<std::int64_t> tracks;
    std::vector<std::pair<int, int>> source;
    const WindowProblem problem = make_problem(&tracks, &source);
    WindowOptions solver = options_.solver;
    solver.estimate_sigma = false;
    solver.fixed_sigma =
        options_.noise_part * std::max(solver.min_sigma, timings_.empty() ? 1.0 : timings_.back().sigma);
    std::vector<Matrix6d> covariances;
    const bool known = window_covariance(problem, solver, pairs, &covariances);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const Pose& later = window_[static_cast<std::size_t>(pairs[i].first)];
      const Pose& earlier = window_[static_cast<std::size_t>(pairs[i].second)];
      StereoConstraint constraint;
      constraint.from = earlier.index;
      constraint.to = later.index;
      constraint.from_from_to = pose_of(earlier).inverse() * pose_of(later);
      // window_covariance() is of b_from_a = camera_b_from_camera_a with b the earlier pose: from_from_to itself.
      constraint.covariance = known ? covariances[i] : later.covariance;
      constraints_.push_back(constraint);
      handed_over_ = later.index;
    }
    if (!timings_.empty()) timings_.back().covariance_ms = milliseconds_since(begin);
  }
  for (int p = 0; p < leave; ++p) {
    for (const Observation& o : window_.front().observations) --points_[o.track].poses;
    window_.pop_front();
  }
  std::set<std::int64_t> seen;
  for (const Pose& pose : window_)
    for (const Observation& o : pose.observations) seen.insert(o.track);
  std::erase_if(points_, [&](const auto& entry) {
    if (seen.contains(entry.first)) return false;
    if (const auto placed = place(entry.second)) left_points_.push_back(*placed);
    return true;
  });
}

// On the feature map: seen often enough, and near enough to the window for its distance to be known.
std::optional<StereoMapPoint> StereoWindow::place(const Point& point) const {
  if (point.seen < kPosesOnMap || !(std::abs(point.world.w()) > 1e-9) || window_.empty()) return std::nullopt;
  const Eigen::Vector3d world = point.world.hnormalized();
  if ((world - pose_of(window_.front()).t).norm() > camera_.depth_m(kFarthest_px)) return std::nullopt;
  return StereoMapPoint{world, point.seen, window_.front().index};
}

void StereoWindow::finish() {
  if (!window_.empty()) hand_over(1);
}

std::vector<StereoMapPoint> StereoWindow::points() const {
  std::vector<StereoMapPoint> out = left_points_;
  for (const auto& [track, point] : points_)
    if (const auto placed = place(point)) out.push_back(*placed);
  return out;
}

}  // namespace parallax
