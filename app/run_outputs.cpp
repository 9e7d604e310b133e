#include "app/run_outputs.h"

#include <algorithm>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "app/game_report.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/file_io.h"
#include "map/map_file.h"

namespace parallax {
namespace {

struct Percentiles {
  double median = 0, p99 = 0, max = 0;
};

Percentiles percentiles(std::vector<float> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    return static_cast<double>(values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1) + 0.5)]);
  };
  return {at(0.5), at(0.99), values.back()};
}

nlohmann::json to_json(const Percentiles& p) { return {{"median", p.median}, {"p99", p.p99}, {"max", p.max}}; }

bool on_map(const TrackingResult& r) { return r.camera_from_world.has_value(); }

nlohmann::json loops_json(const MapperStatistics& mapper) {
  const LoopDetectionStatistics& found = mapper.loops;
  nlohmann::json out = {{"keyframes_looked_up", found.words}, {"alike", found.alike},
                        {"compared", found.compared},         {"found", found.found},
                        {"refused", mapper.loops_refused},    {"closed", mapper.loops_closed},
                        {"words_ms", found.words_ms},         {"compare_ms", found.compare_ms}};
  out["last"] = nlohmann::json::array();
  for (const LoopReport& r : mapper.loop_reports)
    out["last"].push_back({{"closed", r.closed},
                           {"reason", r.reason},
                           {"drift_m", r.drift_m},
                           {"drift_scale", r.drift_scale},
                           {"keyframes", r.keyframes},
                           {"points_fused", r.points_fused},
                           {"joint_points", r.joint_points},
                           {"error_before", r.error_before},
                           {"error_after", r.error_after},
                           {"graph_ms", r.graph_ms},
                           {"fuse_ms", r.fuse_ms},
                           {"adjust_ms", r.adjust_ms},
                           {"commit_ms", r.commit_ms}});
  return out;
}

template <class Get>
std::vector<float> collect(const RunResult& result, Get get) {
  std::vector<float> out;
  for (const TrackingResult& r : result.frames)
    if (on_map(r)) out.push_back(get(r));
  return out;
}

}  // namespace

Trajectory tracked_trajectory(const RunResult& result) {
  Trajectory out;
  if (static_cast<int>(result.frames.size()) < result.frames_delivered) {
    for (const TrackedPose& p : result.poses) {
      const TrackedWorld& world = result.worlds[static_cast<std::size_t>(p.world)];
      if (world.map_version != result.map_version) continue;
      const SimilarityTransform now_from_then = result.world_from_first * world.world_from_first.inverse();
      out.push_back({p.time, now_from_then.rebase({p.rotation, p.translation}).inverse()});
    }
    return out;
  }
  for (const TrackingResult& r : result.frames) {
    if (!r.camera_from_world || r.map_version != result.map_version) continue;
    const SimilarityTransform now_from_then = result.world_from_first * r.world_from_first.inverse();
    out.push_back({r.time, now_from_then.rebase(*r.camera_from_world).inverse()});
  }
  return out;
}

Trajectory keyframe_trajectory(const RunResult& result) {
  Trajectory out;
  for (const Keyframe& kf : result.map.keyframes) out.push_back({kf.time, kf.camera_from_world.inverse()});
  return out;
}

void write_run_map(const RunResult& result, const CameraModel& camera, const std::string& path) {
  if (result.map.empty()) throw RunError(path + ": not written: there is no map");
  MapDocument document;
  if (result.initial_map) document = *result.initial_map;  // its name, and what stands on it
  const WorldState world{result.world_from_first, result.warps};
  for (ContentItem& item : document.content)
    item.world_from_item = world.now_from({}, item.position(), item.seen_from) * item.world_from_item;
  document.map = result.map;
  document.calibration = format_calibration(camera);
  write_map_file(document, path, std::string("parallax ") + PARALLAX_VERSION);
}

void write_points_ply(const Map& map, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << "ply\nformat ascii 1.0\ncomment points of a Parallax map, metres, world frame\nelement vertex "
        << map.points.size()
        << "\nproperty double x\nproperty double y\nproperty double z\nproperty float nx\nproperty float ny\nproperty "
           "float nz\n"
           "property uchar intensity\nproperty uchar level\nproperty int observers\nend_header\n";
    out << std::setprecision(9);
    for (const MapPoint& p : map.points) {
      const GreyImage& image = map.keyframes.at(p.source).images->pyramid.level[p.source_level];
      const int intensity =
          image(static_cast<int>(p.source_pixel.y() + 0.5), static_cast<int>(p.source_pixel.x() + 0.5));
      out << p.position.x() << ' ' << p.position.y() << ' ' << p.position.z() << ' ' << static_cast<float>(p.normal.x())
          << ' ' << static_cast<float>(p.normal.y()) << ' ' << static_cast<float>(p.normal.z()) << ' ' << intensity
          << ' ' << p.source_level << ' ' << p.observers.size() << '\n';
    }
  });
}

void write_timing_csv(const RunResult& result, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << "frame,state,quality,attempted,found,points,keyframes,features_ms,projection_ms,search_ms,pose_ms,recovery_"
           "ms,"
           "total_ms,cpu_ms\n";
    out << std::fixed << std::setprecision(4);
    for (const TrackingResult& r : result.frames) {
      out << r.frame << ',' << to_string(r.state) << ',' << (on_map(r) ? to_string(r.quality) : "none") << ','
          << r.total_attempted() << ',' << r.total_found() << ',' << r.map_points << ',' << r.map_keyframes << ','
          << r.times.features << ',' << r.times.projection << ',' << r.times.search << ',' << r.times.pose << ','
          << r.times.recovery << ',' << r.times.total << ',' << r.times.cpu << '\n';
    }
  });
}

void write_report_json(const RunResult& result, const ReportContext& context, const std::string& path,
                       const GameOutcome* game) {
  const FrameCounts& c = result.counts;
  nlohmann::json report;
  report["program"] = {{"name", "parallax"}, {"version", context.version}};
  report["source"] = {{"name", context.source},
                      {"frames_per_second", context.frames_per_second},
                      {"width", context.camera->width()},
                      {"height", context.camera->height()},
                      {"camera_model", to_string(context.camera->kind())}};
  const TrackerOptions& t = context.options->tracker;
  const MapperOptions& m = context.options->mapper;
  report["settings"] = {{"pace", context.pace},
                        {"speed", context.options->speed},
                        {"init", context.initialisation},
                        {"coarse_points", t.coarse_points},
                        {"fine_points", t.fine_points},
                        {"coarse_radius_px", t.coarse_radius_px},
                        {"fine_radius_px", t.fine_radius_px},
                        {"keyframe_interval_frames", t.keyframe_interval_frames},
                        {"keyframe_distance_over_depth", t.keyframe_distance_over_depth},
                        {"local_keyframes", m.local_keyframes},
                        {"initial_baseline_m", m.initial_baseline_m},
                        {"seed", m.seed}};
  report["frames"] = {{"read", result.frames_read},
                      {"tracked", c.tracked},
                      {"good", c.good},
                      {"poor", c.poor},
                      {"lost", c.lost},
                      {"times_lost", c.losses},
                      {"relocalised", c.relocalised},
                      {"before_map", c.before_map},
                      {"dropped", result.frames_dropped}};
  report["tracked_fraction"] = result.frames_read > 0 ? static_cast<double>(c.tracked) / result.frames_read : 0.0;
  report["wall_seconds"] = result.wall_seconds;
  report["map"] = {{"keyframes", result.map.keyframes.size()}, {"points", result.map.points.size()}};
  std::array<int, kPyramidLevels> level{};
  for (const MapPoint& p : result.map.points) ++level[p.source_level];
  report["map"]["points_of_level"] = level;
  report["tracking_ms"] = {
      {"features", to_json(percentiles(collect(result, [](const auto& r) { return r.times.features; })))},
      {"projection", to_json(percentiles(collect(result, [](const auto& r) { return r.times.projection; })))},
      {"search", to_json(percentiles(collect(result, [](const auto& r) { return r.times.search; })))},
      {"pose", to_json(percentiles(collect(result, [](const auto& r) { return r.times.pose; })))},
      {"total", to_json(percentiles(collect(result, [](const auto& r) { return r.times.total; })))},
      {"cpu", to_json(percentiles(collect(result, [](const auto& r) { return r.times.cpu; })))}};
  report["slowest_frame_ms"] = {{"total", c.slowest_ms}, {"cpu", c.slowest_cpu_ms}};
  report["mapping"] = {{"keyframes_inserted", result.mapper.keyframes_inserted},
                       {"keyframes_refused", result.mapper.keyframes_refused},
                       {"keyframes_rejected", result.mapper.keyframes_rejected},
                       {"keyframes_culled", result.mapper.keyframes_culled},
                       {"points_made", result.mapper.points_made},
                       {"points_erased", result.mapper.points_erased},
                       {"points_merged", result.mapper.points_merged},
                       {"measurements_added", result.mapper.measurements_added},
                       {"adjustments_interrupted", result.mapper.adjustments_interrupted},
                       {"insertion_ms", to_json(percentiles(result.mapper.insertion_ms))},
                       {"local_adjustment_ms", to_json(percentiles(result.mapper.local_ms))},
                       {"global_adjustment_ms", to_json(percentiles(result.mapper.global_ms))}};
  report["loops"] = loops_json(result.mapper);
  report["lock_ms"] = {{"map_wait", to_json(percentiles(result.lock_times.wait_ms))},
                       {"map_hold", to_json(percentiles(result.lock_times.hold_ms))},
                       {"tracker_wait", to_json(percentiles(result.snapshot_waits_ms))}};
  if (game != nullptr) report["game"] = to_json(*game);
  nlohmann::json warnings = nlohmann::json::array();
  for (const SourceWarning& w : result.warnings) warnings.push_back({{"frame", w.frame}, {"text", w.text}});
  report["warnings"] = warnings;
  write_file_atomically(path, [&](std::ostream& out) { out << report.dump(2) << '\n'; });
}

bool tracked_anything(const RunResult& result) { return result.counts.tracked > 0; }

std::string why_not_started(const RunResult& result) {
  if (result.frames_read == 0) return "no frame could be read";
  for (auto it = result.frames.rbegin(); it != result.frames.rend(); ++it)
    if (!it->message.empty()) return it->message;
  return "the camera never moved enough, or saw too little texture";
}

std::string summary_text(const RunResult& result) {
  const FrameCounts& c = result.counts;
  const Percentiles total = percentiles(collect(result, [](const auto& r) { return r.times.total; }));
  std::ostringstream out;
  out << "frames " << result.frames_read << ", tracked " << c.tracked << " ("
      << (result.frames_read > 0 ? 100 * c.tracked / result.frames_read : 0) << " %), lost " << c.lost << ", dropped "
      << result.frames_dropped << "\nmap: " << result.map.keyframes.size() << " keyframes, " << result.map.points.size()
      << " points\ntracking: median " << std::fixed << std::setprecision(2) << total.median << " ms, 99th percentile "
      << total.p99 << " ms a frame\n";
  if (result.mapper.loops_closed > 0) out << "loops closed: " << result.mapper.loops_closed << '\n';
  return out.str();
}

}  // namespace parallax
