#include "core/trajectory_error.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

double angle_deg(const Eigen::Matrix3d& R) { return log_so3(R).norm() * kDegreesPerRadian; }

// The double nearest to the time in seconds. The public tool compares times as such doubles, and their rounding decides
// between two poses that are equally near on paper; whole seconds and the rest apart keep it exact.
double rounded_seconds(Timestamp time) {
  const auto whole = std::chrono::floor<std::chrono::seconds>(time);
  return static_cast<double>(whole.count()) + static_cast<double>((time - whole).count()) / 1e9;
}

double difference_s(const TrajectoryPose& a, const TrajectoryPose& b) {
  return std::abs(rounded_seconds(a.time) - rounded_seconds(b.time));
}

// Index of the pose nearest in time; the earlier of two equally near.
int nearest_in_time(const Trajectory& poses, const TrajectoryPose& to) {
  const auto after = std::lower_bound(poses.begin(), poses.end(), to.time,
                                      [](const TrajectoryPose& pose, Timestamp t) { return pose.time < t; });
  const int index = static_cast<int>(after - poses.begin());
  if (after == poses.end()) return index - 1;
  if (index > 0 && difference_s(poses[index - 1], to) <= difference_s(*after, to)) return index - 1;
  return index;
}

double median_interval_s(const Trajectory& poses) {
  std::vector<double> intervals;
  for (size_t i = 1; i < poses.size(); ++i) intervals.push_back(to_seconds(poses[i].time - poses[i - 1].time));
  return summarise_errors(intervals).median;
}

std::vector<IndexPair> consecutive(const std::vector<int>& places) {
  std::vector<IndexPair> pairs;
  for (size_t i = 1; i < places.size(); ++i) pairs.push_back({places[i - 1], places[i]});
  return pairs;
}

std::vector<double> path_lengths(const Trajectory& path) {
  std::vector<double> lengths(path.size(), 0.0);
  for (size_t i = 1; i < path.size(); ++i) {
    lengths[i] = lengths[i - 1] + (path[i].world_from_camera.t - path[i - 1].world_from_camera.t).norm();
  }
  return lengths;
}

std::vector<IndexPair> pairs_by_path(const Trajectory& path, const RelativePairOptions& options) {
  const auto lengths = path_lengths(path);
  const int n = static_cast<int>(path.size());
  std::vector<IndexPair> pairs;
  if (options.all_pairs) {
    for (int i = 0; i + 1 < n; ++i) {
      const auto at = std::lower_bound(lengths.begin() + i + 1, lengths.end(), lengths[i] + options.delta);
      int best = static_cast<int>(at - lengths.begin());
      const auto miss = [&](int j) { return std::abs(lengths[j] - lengths[i] - options.delta); };
      if (best == n || (best - 1 > i && miss(best - 1) <= miss(best))) --best;
      if (miss(best) <= options.tolerance * options.delta) pairs.push_back({i, best});
    }
    return pairs;
  }
  std::vector<int> places;
  double since_last = 0;
  for (int i = 1; i < n; ++i) {
    since_last += (path[i].world_from_camera.t - path[i - 1].world_from_camera.t).norm();
    if (since_last < options.delta) continue;
    places.push_back(i);
    since_last = 0;
  }
  return consecutive(places);
}

}  // namespace

ErrorStatistics summarise_errors(const std::vector<double>& errors) {
  ErrorStatistics out;
  if (errors.empty()) return out;
  std::vector<double> sorted = errors;
  std::sort(sorted.begin(), sorted.end());
  const size_t n = sorted.size();
  const double count = static_cast<double>(n);
  double sum = 0, sum_of_squares = 0, deviation = 0;
  for (const double e : sorted) {
    sum += e;
    sum_of_squares += e * e;
  }
  out.count = static_cast<int>(n);
  out.mean = sum / count;
  for (const double e : sorted) deviation += (e - out.mean) * (e - out.mean);
  out.rmse = std::sqrt(sum_of_squares / count);
  out.deviation = std::sqrt(deviation / count);
  out.median = n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
  out.min = sorted.front();
  out.max = sorted.back();
  return out;
}

std::vector<PoseMatch> associate_by_time(const Trajectory& estimate, const Trajectory& truth, double max_difference_s) {
  std::vector<PoseMatch> matches;
  if (estimate.empty() || truth.empty()) return matches;
  const bool truth_is_longer = truth.size() > estimate.size();
  const Trajectory& shorter = truth_is_longer ? estimate : truth;
  const Trajectory& longer = truth_is_longer ? truth : estimate;
  const auto difference = [&](int s, int l) { return difference_s(shorter[s], longer[l]); };

  std::map<int, int> taken_by;  // of the longer one -> of the shorter one
  for (int s = 0; s < static_cast<int>(shorter.size()); ++s) {
    const int l = nearest_in_time(longer, shorter[s]);
    if (difference(s, l) > max_difference_s) continue;
    const auto [place, is_new] = taken_by.try_emplace(l, s);
    if (!is_new && difference(s, l) < difference(place->second, l)) place->second = s;
  }
  for (const auto& [l, s] : taken_by) matches.push_back(truth_is_longer ? PoseMatch{s, l} : PoseMatch{l, s});
  return matches;
}

std::vector<PoseMatch> associate_by_line(const Trajectory& estimate, const Trajectory& truth) {
  if (estimate.size() != truth.size()) {
    throw InputError("the trajectories carry no times and are not equally long: the estimate has " +
                     std::to_string(estimate.size()) + " poses, the truth " + std::to_string(truth.size()));
  }
  std::vector<PoseMatch> matches;
  for (int i = 0; i < static_cast<int>(estimate.size()); ++i) matches.push_back({i, i});
  return matches;
}

SimilarityTransform find_alignment(const Trajectory& estimate, const Trajectory& truth,
                                   const std::vector<PoseMatch>& matches, Alignment alignment) {
  if (alignment == Alignment::none) return {};
  const auto n = static_cast<Eigen::Index>(matches.size());
  if (n < 3) {
    throw InputError("an alignment needs at least 3 poses in common, found " + std::to_string(n));
  }
  Eigen::Matrix3Xd source(3, n), target(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    source.col(i) = estimate[matches[i].estimate].world_from_camera.t;
    target.col(i) = truth[matches[i].truth].world_from_camera.t;
  }
  SimilarityTransform truth_from_estimate;
  if (!align_points(source, target, alignment == Alignment::sim3, &truth_from_estimate)) {
    throw InputError("the positions stand still or lie on one line, which leaves the alignment open (--align none)");
  }
  return truth_from_estimate;
}

Trajectory transform_trajectory(const Trajectory& trajectory, const SimilarityTransform& new_from_old) {
  Trajectory out = trajectory;
  for (auto& pose : out) {
    pose.world_from_camera.t = new_from_old * pose.world_from_camera.t;
    pose.world_from_camera.R = new_from_old.R * pose.world_from_camera.R;
  }
  return out;
}

std::vector<double> position_errors(const Trajectory& aligned, const Trajectory& truth,
                                    const std::vector<PoseMatch>& matches) {
  std::vector<double> errors;
  for (const auto& m : matches) {
    errors.push_back((aligned[m.estimate].world_from_camera.t - truth[m.truth].world_from_camera.t).norm());
  }
  return errors;
}

std::vector<double> rotation_errors_deg(const Trajectory& aligned, const Trajectory& truth,
                                        const std::vector<PoseMatch>& matches) {
  std::vector<double> errors;
  for (const auto& m : matches) {
    errors.push_back(
        angle_deg(truth[m.truth].world_from_camera.R.transpose() * aligned[m.estimate].world_from_camera.R));
  }
  return errors;
}

void RelativePairOptions::validate() const {
  if (!(delta > 0) || !std::isfinite(delta)) throw InputError("the step of the relative error must be above 0");
  if (!in_metres && (delta != std::floor(delta) || delta > 1e9)) {
    throw InputError("the step of the relative error in frames must be a whole number");
  }
  if (!(tolerance >= 0)) throw InputError("the tolerance of the relative error must not be negative");
}

std::vector<IndexPair> relative_pairs(const Trajectory& path, const RelativePairOptions& options) {
  options.validate();
  if (options.in_metres) return pairs_by_path(path, options);
  const int n = static_cast<int>(path.size()), delta = static_cast<int>(options.delta);
  std::vector<IndexPair> pairs;
  if (delta >= n) return pairs;
  for (int i = 0; i < n - delta; i += options.all_pairs ? 1 : delta) pairs.push_back({i, i + delta});
  return pairs;
}

RelativeErrors relative_errors(const Trajectory& aligned, const Trajectory& truth,
                               const std::vector<PoseMatch>& matches, const RelativePairOptions& options) {
  Trajectory path;
  for (const auto& m : matches) path.push_back(aligned[m.estimate]);
  RelativeErrors errors;
  for (const auto& [first, second] : relative_pairs(path, options)) {
    const RigidTransform& truth_first = truth[matches[first].truth].world_from_camera;
    const RigidTransform& truth_second = truth[matches[second].truth].world_from_camera;
    const RigidTransform true_motion = truth_first.inverse() * truth_second;
    const RigidTransform motion = path[first].world_from_camera.inverse() * path[second].world_from_camera;
    const RigidTransform difference = true_motion.inverse() * motion;
    errors.translation.push_back(difference.t.norm());
    errors.rotation_deg.push_back(angle_deg(difference.R));
  }
  return errors;
}

int expected_frames(const Trajectory& estimate, const Trajectory& truth) {
  // Rates within this factor are the same rate, with poses missing here and there.
  constexpr double kClearlyHigherRate = 1.5;
  const double estimate_interval = median_interval_s(estimate), truth_interval = median_interval_s(truth);
  if (truth.size() < 2 || estimate.size() < 2 || estimate_interval < kClearlyHigherRate * truth_interval) {
    return static_cast<int>(truth.size());
  }
  const double duration = to_seconds(truth.back().time - truth.front().time);
  return static_cast<int>(std::lround(duration / estimate_interval)) + 1;
}

void TrajectoryErrorOptions::validate() const {
  if (!(max_time_difference_s >= 0)) throw InputError("the largest time difference must not be negative");
  relative.validate();
}

TrajectoryError evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                    const TrajectoryErrorOptions& options) {
  options.validate();
  TrajectoryError out;
  out.matches = options.match_by_line ? associate_by_line(estimate, truth)
                                      : associate_by_time(estimate, truth, options.max_time_difference_s);
  if (out.matches.empty()) {
    throw InputError("no estimated pose is within " + std::to_string(options.max_time_difference_s) +
                     " s of a true one: the trajectories do not overlap in time");
  }
  out.truth_from_estimate = find_alignment(estimate, truth, out.matches, options.alignment);
  out.aligned = transform_trajectory(estimate, out.truth_from_estimate);
  try {
    out.scale = find_alignment(estimate, truth, out.matches, Alignment::sim3).s;
    if (out.scale > 0) out.scale_error = 1.0 / out.scale - 1.0;
  } catch (const InputError&) {
    out.scale = 0;  // the path does not determine it
  }
  out.frames = options.frames > 0      ? options.frames
               : options.match_by_line ? static_cast<int>(truth.size())
                                       : expected_frames(estimate, truth);
  out.tracked_fraction = std::min(1.0, static_cast<double>(out.matches.size()) / out.frames);
  out.position = position_errors(out.aligned, truth, out.matches);
  out.rotation_deg = rotation_errors_deg(out.aligned, truth, out.matches);
  out.relative = relative_errors(out.aligned, truth, out.matches, options.relative);
  return out;
}

}  // namespace parallax
