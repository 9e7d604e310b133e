#include "app/session_report_data.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "app/session_outputs.h"
#include "mapper/textured_map.h"
#include "sessions/session_database.h"
#include "sessions/session_optimiser.h"

namespace parallax {
namespace {

constexpr int kSpreadsASession = 12;
constexpr std::size_t kMostFeaturePoints = 60000;  // of a session
constexpr int kMostTexturedKeyframes = 300;        // of all sessions

std::string setting_text(double value) {
  std::string text = std::to_string(value);
  while (text.ends_with('0')) text.pop_back();
  if (text.ends_with('.')) text.pop_back();
  return text;
}

std::vector<std::pair<std::string, std::string>> settings_of(const SlamSessionsOptions& options) {
  const auto yes = [](bool value) { return std::string(value ? "yes" : "no"); };
  const StereoTrackerOptions& t = options.slam.tracker;
  const StereoWindowOptions& w = options.slam.window;
  const PlaceRecogniserOptions& p = options.back_end.places;
  const EncounterVoteOptions& v = options.back_end.vote;
  return {{"pace", options.slam.pace == Pace::lockstep ? "lockstep" : "realtime"},
          {"speed", setting_text(options.slam.speed)},
          {"sessions at once", yes(options.at_once)},
          {"loops within sessions", yes(options.back_end.loops)},
          {"meetings between sessions", yes(options.back_end.meetings)},
          {"images kept", yes(!options.database.empty() && options.back_end.keep_images)},
          {"stereo.features", std::to_string(t.features)},
          {"stereo.keyframe_distance_m", setting_text(t.keyframe_distance_m)},
          {"stereo.keyframe_angle_rad", setting_text(t.keyframe_angle_rad)},
          {"window.poses", std::to_string(w.poses)},
          {"window.kept_poses", std::to_string(w.kept_poses)},
          {"window.hand_over_at_loop", yes(options.link.hand_over_at_loop)},
          {"sessions.new_after_failure", yes(options.link.new_session_after_failure)},
          {"places.alpha_minus", setting_text(p.alpha_minus)},
          {"places.alpha_plus", setting_text(p.alpha_plus)},
          {"places.beta_near", setting_text(p.beta_near)},
          {"places.beta_far", setting_text(p.beta_far)},
          {"places.use_crf", yes(p.use_crf)},
          {"vote.within_session", std::to_string(v.within_session)},
          {"vote.between_sessions", std::to_string(v.between_sessions)}};
}

// Of a keyframe as the front end numbers it; null: there is none.
const SlamLinkPart* part_of(const SlamSessionOutcome& session, int local) {
  const SlamLinkPart* out = nullptr;
  for (const SlamLinkPart& part : session.parts)
    if (part.first_local <= local) out = &part;
  return out;
}

// The document of a run that kept no database: all sessions are of the run.
SessionDocument document_of_run(const SlamSessionsResult& run) {
  SessionDocument document;
  document.sessions = run.view.sessions;
  document.poses = run.view.poses;
  document.encounters = run.view.encounters;
  for (const SlamSessionOutcome& session : run.sessions)
    for (StereoConstraint constraint : session.result.constraints) {
      const SlamLinkPart* part = part_of(session, constraint.to);
      if (part == nullptr || constraint.from < part->first_local) continue;  // nothing ties parts
      constraint.from = part->keyframe_of(constraint.from);
      constraint.to = part->keyframe_of(constraint.to);
      document.constraints.push_back({part->state.id, constraint});
    }
  return document;
}

// As the front ends had it, when the back end was elsewhere: each session on its own, in the front end's frame.
BackEndView view_of_front_ends(const SlamSessionsResult& run) {
  BackEndView view;
  for (const SlamSessionOutcome& session : run.sessions) {
    view.sessions.push_back(session.state);
    view.sessions.back().component = session.state.id;
    view.sessions.back().global_from_session = RigidTransform();
    const auto& poses = session.result.keyframes;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const bool after_failure =
          i > 0 && i <= session.result.constraints.size() && session.result.constraints[i - 1].after_failure;
      view.poses.push_back({{session.state.id, static_cast<int>(i)},
                            poses[i].frame,
                            poses[i].time,
                            after_failure,
                            poses[i].world_from_camera});
    }
  }
  std::sort(view.poses.begin(), view.poses.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  return view;
}

// Constraints are of a kind that a graph can be built of: in turn, from keyframe 0.
bool makes_a_graph(const SessionDocument& document) {
  std::map<int, int> next;
  for (const SessionState& state : document.sessions)
    if (state.id < 1 || !next.try_emplace(state.id, 1).second) return false;
  for (const auto& [session, constraint] : document.constraints) {
    const auto found = next.find(session);
    if (found == next.end() || constraint.from + 1 != constraint.to || constraint.to > found->second) return false;
    if (constraint.to == found->second) ++found->second;
  }
  return true;
}

void add_spreads_of(const SessionDocument& document, SessionScene* scene) {
  if (document.sessions.empty() || !makes_a_graph(document)) return;
  SessionGraph graph;
  build_session_graph(document, &graph);
  graph.optimise();
  add_spreads(graph, kSpreadsASession, scene);
}

// Points of the front end, told from the keyframes that they follow; `elsewhere`: as view_of_front_ends() numbers them.
void add_points_of_run(const SlamSessionsResult& run, bool elsewhere, SessionScene* scene) {
  for (const SlamSessionOutcome& session : run.sessions) {
    std::map<int, std::vector<SessionPoint>> by_session;
    for (const StereoMapPoint& point : session.result.points) {
      const SlamLinkPart* part = part_of(session, point.keyframe);
      if (point.keyframe < 0 || point.keyframe >= static_cast<int>(session.before.size())) continue;
      const RigidTransform& reference = session.before[static_cast<std::size_t>(point.keyframe)].world_from_camera;
      const Eigen::Vector3f camera = (reference.inverse() * point.world).cast<float>();
      if (elsewhere)
        by_session[session.state.id].push_back({point.keyframe, camera, point.poses});
      else if (part != nullptr)
        by_session[part->state.id].push_back({part->keyframe_of(point.keyframe), camera, point.poses});
    }
    for (const auto& [id, points] : by_session) add_feature_points(id, points, kMostFeaturePoints, scene);
  }
}

void add_points_of_database(SessionDatabase* database, SessionScene* scene) {
  for (const SceneSession& session : scene->sessions)
    add_feature_points(session.id, database->points(session.id), kMostFeaturePoints, scene);
}

// Points with the images' colours in place of features, where images were kept.
bool add_textured_points(SessionDatabase* database, const std::vector<SessionState>& states, SessionScene* scene) {
  std::size_t keyframes = 0;
  for (const SceneSession& session : scene->sessions) keyframes += session.poses.size();
  const int step = std::max(1, static_cast<int>((keyframes + kMostTexturedKeyframes - 1) / kMostTexturedKeyframes));
  bool any = false;
  for (SceneSession& session : scene->sessions) {
    std::unique_ptr<TexturedMap> map;
    TexturedMapOptions options;
    options.voxel_m = 0.05;
    options.most_points = 500000;
    if (step > 2) options.least_views = 1;  // the next keyframe that is taken is too far to see it again
    for (const SessionState& state : states)
      if (state.id == session.id) map = std::make_unique<TexturedMap>(state.start.camera, options);
    for (std::size_t i = 0; i < session.poses.size(); i += static_cast<std::size_t>(step)) {
      GreyImage left, right;
      if (!map || !database->images({session.id, static_cast<int>(i)}, &left, &right)) continue;
      map->add({static_cast<int>(i), session.poses[i].global_from_camera, left, right, {}});
    }
    if (!map || map->keyframes() == 0) continue;
    std::vector<ColouredPoint> points = map->points();
    if (points.empty()) continue;
    session.points = std::move(points);
    session.textured = any = true;
  }
  return any;
}

std::vector<const SessionTiming*> timings_of(const SessionReportData& data, SessionModule module) {
  std::vector<const SessionTiming*> out;
  for (const SessionTiming& timing : data.timings)
    if (timing.module == module && std::isfinite(timing.ms)) out.push_back(&timing);
  return out;
}

bool is_of_frames(SessionModule module) {
  return module == SessionModule::feature_tracking || module == SessionModule::stereo_odometry;
}

}  // namespace

SessionScene scene_of_run(const SlamSessionsResult& run, const std::string& database_path) {
  const bool elsewhere = run.view.poses.empty();
  SessionScene scene = make_session_scene(elsewhere ? view_of_front_ends(run) : run.view);
  if (!database_path.empty()) {
    SessionDatabase database(database_path, SqliteMode::read);
    const SessionDocument document = database.read();
    add_spreads_of(document, &scene);
    add_points_of_database(&database, &scene);
    add_textured_points(&database, document.sessions, &scene);
  } else {
    if (!elsewhere) add_spreads_of(document_of_run(run), &scene);
    add_points_of_run(run, elsewhere, &scene);
  }
  return scene;
}

SessionReportData report_on_run(const SlamSessionsResult& run, const SlamSessionsOptions& options) {
  SessionReportData data;
  data.program = "parallax " PARALLAX_VERSION;
  data.origin =
      "a run of " + std::to_string(run.sessions.size()) + (run.sessions.size() == 1 ? " session" : " sessions");
  data.settings = settings_of(options);
  const bool elsewhere = run.view.poses.empty();
  data.view = elsewhere ? view_of_front_ends(run) : run.view;
  data.scene = scene_of_run(run, elsewhere ? std::string() : options.database);
  data.timings = run.timings;
  if (elsewhere) {
    data.not_known.push_back(
        "The back end was another process: what it found and how long it took are in its database, and not known "
        "here.");
    for (const SlamSessionOutcome& session : run.sessions) {
      for (const SlamFrame& frame : session.result.frames) {
        const PoseKey key{session.state.id, frame.result.frame};
        data.timings.push_back({key, SessionModule::feature_tracking, frame.result.timing.feature_tracking_ms, false});
        data.timings.push_back({key, SessionModule::stereo_odometry, frame.result.timing.odometry_ms, false});
      }
      for (const StereoWindowTiming& t : session.result.window_timings)
        data.timings.push_back({{session.state.id, t.keyframe}, SessionModule::window, t.smoothing_ms, false});
    }
  }
  for (const SlamSessionOutcome& session : run.sessions) {
    data.frames[session.state.id] = {session.result.frames_read, session.result.frames_dropped, session.result.failures,
                                     session.result.wall_seconds};
    for (const SourceWarning& warning : session.result.warnings)
      data.warnings.push_back({session.state.start.name, warning.text});
  }
  data.warnings_known = true;
  data.refused_places_known = !elsewhere;
  for (const PlaceEncounter& place : run.refused) ++data.refused_places[place.refused];
  return data;
}

SessionReportData report_on_database(SessionDatabase* database) {
  SessionReportData data;
  data.program = "parallax " PARALLAX_VERSION;
  data.origin = database->path();
  const SessionDocument document = database->read();
  data.view.sessions = document.sessions;
  data.view.poses = document.poses;
  data.view.encounters = document.encounters;
  data.scene = make_session_scene(data.view);
  data.timings = database->timings();
  add_spreads_of(document, &data.scene);
  add_points_of_database(database, &data.scene);
  if (!add_textured_points(database, document.sessions, &data.scene))
    data.not_known.push_back("Images were not kept: the maps show features, not textures.");
  return data;
}

ModuleTimes times_of_module(const SessionReportData& data, SessionModule module, std::optional<bool> loop) {
  ModuleTimes out;
  const std::vector<const SessionTiming*> timings = timings_of(data, module);
  for (const SessionTiming* t : timings) {
    if (loop && t->loop != *loop) continue;
    ++out.count;
    out.mean_ms += t->ms;
    out.sum_s += 1e-3 * t->ms;
    if (out.count > 1 && t->ms <= out.worst_ms) continue;
    out.worst_ms = t->ms;
    out.worst_at = t->key;
  }
  if (out.count == 0) return out;
  out.mean_ms /= static_cast<double>(out.count);
  for (const SessionTiming* t : timings)
    if (!loop || t->loop == *loop)
      out.variance_ms2 += (t->ms - out.mean_ms) * (t->ms - out.mean_ms) / static_cast<double>(out.count);
  return out;
}

SessionCounts counts_of_session(const SessionReportData& data, int session) {
  SessionCounts out;
  if (const SceneSession* of = data.scene.session(session)) {
    out.poses = static_cast<int>(of->poses.size());
    out.seconds = of->seconds();
    out.path_m = of->path_m();
    out.failures = static_cast<int>(
        std::count_if(of->poses.begin(), of->poses.end(), [](const ScenePose& pose) { return pose.after_failure; }));
  }
  for (const Encounter& encounter : data.view.encounters) {
    if (encounter.state != EncounterState::active) continue;
    const bool found = encounter.found.session == session, query = encounter.query.session == session;
    if (found && query) ++out.loops;
    if (found != query) ++out.meetings;
  }
  return out;
}

SessionCounts counts_of_all(const SessionReportData& data) {
  SessionCounts out;
  for (const SceneSession& session : data.scene.sessions) {
    const SessionCounts of = counts_of_session(data, session.id);
    out.poses += of.poses;
    out.failures += of.failures;
    out.seconds += of.seconds;
    out.path_m += of.path_m;
    out.loops += of.loops;
    out.meetings += of.meetings;
  }
  out.meetings /= 2;
  return out;
}

std::map<int, double> session_offsets(const SessionReportData& data) {
  std::set<int> with_times;
  for (const SessionTiming& timing : data.timings) with_times.insert(timing.key.session);
  std::map<int, double> out;
  double offset = 0;
  for (const SceneSession& session : data.scene.sessions) {
    if (!with_times.contains(session.id)) continue;
    out[session.id] = offset;
    offset += session.seconds();
  }
  return out;
}

std::vector<CanvasPoint> cumulative_times(const SessionReportData& data, SessionModule module) {
  const std::map<int, double> offsets = session_offsets(data);
  std::map<PoseKey, double> spent;  // by keyframe
  for (const SessionTiming* t : timings_of(data, module)) spent[t->key] += 1e-3 * t->ms;
  std::vector<CanvasPoint> out;
  double sum = 0;
  for (const auto& [key, seconds] : spent) {
    const auto offset = offsets.find(key.session);
    sum += seconds;
    if (offset == offsets.end()) continue;
    const SceneSession& session = *data.scene.session(key.session);
    const ScenePose* pose = data.scene.pose(key);
    if (is_of_frames(module))
      out.push_back({offset->second + session.seconds_of_frame(key.keyframe), sum});
    else if (pose != nullptr)
      out.push_back({offset->second + pose->seconds, sum});
  }
  if (!out.empty()) out.insert(out.begin(), CanvasPoint{0, 0});
  return out;
}

const char* name_of(SessionModule module) {
  switch (module) {
    case SessionModule::feature_tracking:
      return "feature tracking";
    case SessionModule::stereo_odometry:
      return "stereo odometry";
    case SessionModule::window:
      return "windowed bundle adjustment";
    case SessionModule::place_recognition:
      return "place recognition";
    case SessionModule::pose_graph:
      return "pose graph";
  }
  return "";
}

}  // namespace parallax
