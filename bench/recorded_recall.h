// Recall of relocalisation on a recording: a map made of its first part, frozen, and asked for frames of the rest, in
// no order, each on its own. What bench_relocalisation_recorded prints, and a test holds to its bar.
//
// A probe counts when, at its true pose, at least a third of the points that some keyframe measures lie in its image
// and are seen from less than 45 degrees beside that keyframe. One call of Relocaliser::recover a probe, with no idea
// of where the camera is. Errors are against the recording's truth, aligned by the poses of the mapped part; an
// accepted pose is wrong beyond 25 cm or 2 degrees plus what the map itself is off by.
#pragma once

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "camera/frame_source.h"
#include "map/shared_map.h"
#include "mapper/mapper.h"
#include "tracker/frame_features.h"
#include "tracker/relocaliser.h"
#include "tracker/tracker.h"

namespace parallax::recorded_recall {

struct Recall {
  std::size_t keyframes = 0;
  double map_error_m = 0;           // the largest of the mapped part's poses
  int probes = 0, sharing = 0;      // of these, a third of their view is mapped
  int close = 0, near = 0;          // of the sharing: within 10 cm and 1 degree, 25 cm and 2 degrees
  int others_found = 0, wrong = 0;  // rightly though nothing counts on it; wrong accepts
  std::vector<double> ms;           // processor time of a try, sorted
};

inline constexpr double kDegree = std::numbers::pi / 180;

inline double cpu_ms() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

// The recording's truth by time, to the nearest within half a frame.
class Truth {
 public:
  explicit Truth(const std::vector<StampedPose>& poses) {
    for (const StampedPose& p : poses) poses_[p.time.count()] = p.world_from_camera;
  }
  const RigidTransform* at(Timestamp time) const {
    auto it = poses_.lower_bound(time.count());
    if (it == poses_.end() || (it != poses_.begin() && time.count() - std::prev(it)->first < it->first - time.count()))
      it = it == poses_.begin() ? it : std::prev(it);
    return it != poses_.end() && std::abs(it->first - time.count()) < 16'000'000 ? &it->second : nullptr;
  }

 private:
  std::map<std::int64_t, RigidTransform> poses_;
};

inline double largest_share(const TrackingSnapshot& snapshot, const Map& map, const CameraModel& camera,
                            const RigidTransform& camera_from_world) {
  double most = 0;
  const Eigen::Vector3d centre = camera_from_world.inverse().t;
  for (const SnapshotKeyframe& kf : snapshot.keyframes) {
    const Keyframe& keyframe = map.keyframes.at(kf.id);
    int seen = 0;
    for (const Measurement& m : keyframe.measurements) {
      const Eigen::Vector3d& p = map.points.at(m.point).position;
      Eigen::Vector2d pixel;
      const Eigen::Vector3d in_camera = camera_from_world * p;
      if (!(in_camera.z() > 0) || !camera.project(in_camera, &pixel) || !camera.in_image(pixel, 0.0)) continue;
      seen += (centre - p).normalized().dot((kf.centre - p).normalized()) > std::numbers::sqrt2 / 2 ? 1 : 0;
    }
    if (!keyframe.measurements.empty()) most = std::max(most, seen / static_cast<double>(keyframe.measurements.size()));
  }
  return most;
}

// With `keys` the map begins with these frames, else with frames chosen automatically. Nothing when no map was made.
inline std::optional<Recall> measure(const std::string& folder, int mapped, std::optional<std::pair<int, int>> keys,
                                     int count) {
  const auto source = open_frame_source(folder, SourceOptions{});
  const CameraModel camera = source->calibration().value();
  const Truth truth(source->ground_truth());
  SharedMap shared;
  MapperInbox inbox(32);
  Mapper mapper(camera, MapperOptions{}, &shared, &inbox);
  Tracker tracker(camera, TrackerOptions{}, !keys, &shared, &inbox);
  std::vector<TrackingResult> results;
  std::vector<Frame> probes;
  for (int i = 0; auto frame = source->next(); ++i) {
    if (i >= mapped) {
      probes.push_back(std::move(*frame));
      continue;
    }
    results.push_back(tracker.track(*frame, keys && (i == keys->first || i == keys->second)));
    while (mapper.step()) {
    }
  }
  const MapCopy end = shared.copy();
  const auto snapshot = shared.snapshot();
  std::vector<Eigen::Vector3d> from, to;
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  for (const TrackingResult& r : results) {
    const RigidTransform* t = truth.at(r.time);
    if (!t || !r.camera_from_world || r.map_version != end.map_version) continue;
    const RigidTransform pose =
        (end.world_from_first * r.world_from_first.inverse()).rebase(*r.camera_from_world).inverse();
    from.push_back(pose.t);
    to.push_back(t->t);
    turns += t->R * pose.R.transpose();
  }
  if (from.size() < 10) return std::nullopt;
  const auto matrix = [](const std::vector<Eigen::Vector3d>& v) {
    return Eigen::Matrix3Xd(
        Eigen::Map<const Eigen::Matrix3Xd>(v.front().data(), 3, static_cast<Eigen::Index>(v.size())));
  };
  const Eigen::Matrix3Xd a = matrix(from), b = matrix(to);
  SimilarityTransform truth_from_map;
  align_points(a, b, true, &truth_from_map);
  // A hand moves along little more than a line: the rotation is that of the poses, not of their places.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turns, Eigen::ComputeFullU | Eigen::ComputeFullV);
  truth_from_map.R = svd.matrixU() * svd.matrixV().transpose();
  const Eigen::Vector3d mean_a = a.rowwise().mean(), mean_b = b.rowwise().mean();
  truth_from_map.t = mean_b - truth_from_map.s * (truth_from_map.R * mean_a);
  double map_error = 0;
  for (Eigen::Index i = 0; i < a.cols(); ++i)
    map_error = std::max(map_error, (truth_from_map * Eigen::Vector3d(a.col(i)) - b.col(i)).norm());

  std::mt19937_64 rng(1);
  std::shuffle(probes.begin(), probes.end(), rng);
  if (static_cast<int>(probes.size()) > count) probes.resize(static_cast<std::size_t>(count));
  Relocaliser relocaliser(camera, TrackerOptions{});
  TwoStageTracker two_stage(camera, TrackerOptions{});
  FrameFeatures features(camera.width(), camera.height(), TrackerOptions{});
  const RigidTransform nowhere(Eigen::Matrix3d::Identity(), {0, 0, 1e3});
  TwoStageResult result;
  {  // all points are described before the first probe
    const auto blank = features.compute(GreyImage(camera.height(), camera.width(), std::uint8_t{90}));
    for (std::size_t i = 0; i < snapshot->keyframes.size(); ++i)
      relocaliser.recover(*snapshot, *blank, nowhere, &two_stage, &result);
  }
  Recall out;
  out.keyframes = snapshot->keyframes.size();
  out.map_error_m = map_error;
  for (const Frame& probe : probes) {
    const RigidTransform* t = truth.at(probe.time);
    if (!t) continue;
    ++out.probes;
    std::shared_ptr<const FrameImages> images;
    for (int k = 0; k < 12; ++k) images = features.compute(probe.grey);  // thresholds settle as in a running tracker
    const RigidTransform expected = truth_from_map.inverse().rebase(t->inverse());
    const bool counts = largest_share(*snapshot, end.map, camera, expected) >= 1.0 / 3;
    out.sharing += counts ? 1 : 0;
    two_stage.clear_cache();
    relocaliser.reset();
    const double start = cpu_ms();
    const bool accepted = relocaliser.recover(*snapshot, *images, nowhere, &two_stage, &result);
    out.ms.push_back(cpu_ms() - start);
    if (!accepted) continue;
    const RigidTransform found = truth_from_map.rebase(result.camera_from_world).inverse();
    const double distance = (found.t - t->t).norm(), angle = (found.inverse() * *t).angle() / kDegree;
    if (distance > 0.25 + map_error || angle > 2) {
      ++out.wrong;
      std::fprintf(stderr, "frame %d: %.3f m, %.2f degrees, %d inliers, sigma %.2f\n", probe.index, distance, angle,
                   result.inliers, result.sigma);
    } else if (counts) {
      out.near += distance <= 0.25 ? 1 : 0;
      out.close += distance <= 0.10 && angle <= 1 ? 1 : 0;
    } else {
      ++out.others_found;
    }
  }
  std::sort(out.ms.begin(), out.ms.end());
  return out;
}

}  // namespace parallax::recorded_recall
