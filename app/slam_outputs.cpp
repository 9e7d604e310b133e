#include "app/slam_outputs.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/file_io.h"
#include "core/graph_file.h"
#include "sessions/session_export.h"

namespace parallax {
namespace {

// As MS Table 2 has them, and the worst.
struct Times {
  double mean = 0, variance = 0, median = 0, p99 = 0, worst = 0;
  std::size_t count = 0;
};

Times times_of(std::vector<double> ms) {
  Times out;
  out.count = ms.size();
  if (ms.empty()) return out;
  std::sort(ms.begin(), ms.end());
  for (const double value : ms) out.mean += value / static_cast<double>(ms.size());
  for (const double value : ms)
    out.variance += (value - out.mean) * (value - out.mean) / static_cast<double>(ms.size());
  const auto at = [&](double part) {
    return ms[static_cast<std::size_t>(part * static_cast<double>(ms.size() - 1) + 0.5)];
  };
  out.median = at(0.5);
  out.p99 = at(0.99);
  out.worst = ms.back();
  return out;
}

nlohmann::json to_json(const Times& t) {
  return {{"count", t.count},   {"mean", t.mean}, {"variance", t.variance},
          {"median", t.median}, {"p99", t.p99},   {"worst", t.worst}};
}

struct SlamTimes {
  Times rectification, tracking, odometry, frame, window, covariance;
};

SlamTimes slam_times(const SlamResult& result) {
  std::vector<double> rectification, tracking, odometry, frame, window, covariance;
  for (const SlamFrame& f : result.frames) {
    rectification.push_back(f.rectification_ms);
    tracking.push_back(f.result.timing.feature_tracking_ms);
    odometry.push_back(f.result.timing.odometry_ms);
    frame.push_back(tracking.back() + odometry.back());
  }
  for (const StereoWindowTiming& t : result.window_timings) {
    if (t.poses > 1) window.push_back(t.smoothing_ms);
    if (t.covariance_ms > 0) covariance.push_back(t.covariance_ms);
  }
  return {times_of(rectification), times_of(tracking), times_of(odometry),
          times_of(frame),         times_of(window),   times_of(covariance)};
}

double path_length(const std::vector<StereoSessionPose>& keyframes) {
  double length = 0;
  for (std::size_t i = 1; i < keyframes.size(); ++i)
    length += (keyframes[i].world_from_camera.t - keyframes[i - 1].world_from_camera.t).norm();
  return length;
}

struct StateCounts {
  int started = 0, tracked = 0, few_features = 0, failed = 0;
};

StateCounts count_states(const SlamResult& result) {
  StateCounts counts;
  for (const SlamFrame& f : result.frames) {
    if (f.result.state == StereoState::started) ++counts.started;
    if (f.result.state == StereoState::tracked) ++counts.tracked;
    if (f.result.state == StereoState::few_features) ++counts.few_features;
    if (f.result.state == StereoState::failed) ++counts.failed;
  }
  return counts;
}

}  // namespace

void write_slam_points_ply(const SlamResult& result, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << "ply\nformat ascii 1.0\ncomment feature map of a Parallax stereo session, metres, world frame\nelement "
           "vertex "
        << result.points.size()
        << "\nproperty double x\nproperty double y\nproperty double z\nproperty int observers\nend_header\n"
        << std::setprecision(9);
    for (const StereoMapPoint& p : result.points)
      out << p.world.x() << ' ' << p.world.y() << ' ' << p.world.z() << ' ' << p.poses << '\n';
  });
}

void write_slam_graph(const SlamResult& result, const std::string& path) {
  GraphFile graph;
  for (std::size_t i = 0; i < result.keyframes.size(); ++i)
    graph.vertices.push_back({static_cast<std::int64_t>(i), result.keyframes[i].world_from_camera});
  for (const StereoConstraint& c : result.constraints)
    graph.edges.push_back({c.from, c.to, c.from_from_to, g2o_information(c.from_from_to, c.covariance)});
  write_graph_file(path, graph);
}

void write_slam_timing_csv(const SlamResult& result, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << "frame,state,reference,tracks,inliers,right_matches,hypotheses,keyframe,rectification_ms,feature_tracking_"
           "ms,"
           "odometry_ms\n"
        << std::fixed << std::setprecision(4);
    for (const SlamFrame& f : result.frames)
      out << f.result.frame << ',' << to_string(f.result.state) << ',' << f.result.reference << ',' << f.result.tracks
          << ',' << f.result.inliers << ',' << f.result.right_matches << ',' << f.result.hypotheses << ','
          << (f.is_keyframe ? 1 : 0) << ',' << f.rectification_ms << ',' << f.result.timing.feature_tracking_ms << ','
          << f.result.timing.odometry_ms << '\n';
    out << "\nkeyframe,poses,points,observations,iterations,sigma,smoothing_ms,covariance_ms\n";
    for (const StereoWindowTiming& t : result.window_timings)
      out << t.keyframe << ',' << t.poses << ',' << t.points << ',' << t.observations << ',' << t.iterations << ','
          << t.sigma << ',' << t.smoothing_ms << ',' << t.covariance_ms << '\n';
  });
}

void write_slam_report_json(const SlamResult& result, const SlamReportContext& context, const std::string& path) {
  const StateCounts counts = count_states(result);
  const SlamTimes times = slam_times(result);
  nlohmann::json report;
  report["program"] = {{"name", "parallax"}, {"version", context.version}};
  report["source"] = {{"name", context.source},
                      {"frames_per_second", context.frames_per_second},
                      {"width", result.camera.width},
                      {"height", result.camera.height},
                      {"focal_px", result.camera.focal_px.x()},
                      {"centre_px", {result.camera.centre_px.x(), result.camera.centre_px.y()}},
                      {"baseline_m", result.camera.baseline_m}};
  report["settings"] = {{"pace", context.pace},
                        {"speed", context.options->speed},
                        {"features", context.options->tracker.features},
                        {"window_poses", context.options->window.poses},
                        {"window_kept_poses", context.options->window.kept_poses},
                        {"keyframe_distance_m", context.options->tracker.keyframe_distance_m},
                        {"keyframe_angle_rad", context.options->tracker.keyframe_angle_rad},
                        {"seed", context.options->tracker.seed}};
  report["frames"] = {{"read", result.frames_read}, {"dropped", result.frames_dropped},    {"started", counts.started},
                      {"tracked", counts.tracked},  {"few_features", counts.few_features}, {"failed", counts.failed}};
  report["failures"] = result.failures;
  report["wall_seconds"] = result.wall_seconds;
  report["map"] = {{"poses", result.keyframes.size()},
                   {"constraints", result.constraints.size()},
                   {"points", result.points.size()},
                   {"windows", result.windows},
                   {"path_m", path_length(result.keyframes)}};
  report["times_ms"] = {
      {"rectification", to_json(times.rectification)},       {"feature_tracking", to_json(times.tracking)},
      {"stereo_odometry", to_json(times.odometry)},          {"frame", to_json(times.frame)},
      {"windowed_bundle_adjustment", to_json(times.window)}, {"covariances", to_json(times.covariance)}};
  nlohmann::json warnings = nlohmann::json::array();
  for (const SourceWarning& w : result.warnings) warnings.push_back({{"frame", w.frame}, {"text", w.text}});
  report["warnings"] = warnings;
  write_file_atomically(path, [&](std::ostream& out) { out << report.dump(2) << '\n'; });
}

std::string slam_summary_text(const SlamResult& result) {
  const StateCounts counts = count_states(result);
  const SlamTimes times = slam_times(result);
  std::ostringstream out;
  out << "frames " << result.frames_read << ", tracked " << counts.tracked + counts.few_features << " ("
      << counts.few_features << " with few features), failures " << result.failures << ", dropped "
      << result.frames_dropped << '\n';
  out << std::fixed << std::setprecision(2) << "poses " << result.keyframes.size() << " over "
      << path_length(result.keyframes) << " m, windows " << result.windows << ", points " << result.points.size()
      << "\n                      mean ms   variance  worst ms\n";
  const auto row = [&](const char* name, const Times& t) {
    out << std::left << std::setw(20) << name << std::right << std::setw(9) << t.mean << std::setw(11) << t.variance
        << std::setw(10) << t.worst << '\n';
  };
  row("feature tracking", times.tracking);
  row("stereo odometry", times.odometry);
  row("window", times.window);
  return out.str();
}

}  // namespace parallax
