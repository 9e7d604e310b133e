#include "app/sessions_text.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <vector>

#include "app/session_outputs.h"
#include "sessions/session_export.h"

namespace parallax {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;
constexpr EncounterState kEncounterStates[] = {EncounterState::active, EncounterState::waiting, EncounterState::refused,
                                               EncounterState::off};

std::string fixed_text(double value, int decimals) {
  if (std::isnan(value)) return "-";
  std::ostringstream out;
  out << std::fixed << std::setprecision(decimals) << value;
  return out.str();
}

// Columns as wide as what is in them, two spaces apart; those marked are flush right.
std::string table_text(const std::vector<std::vector<std::string>>& rows, const std::vector<bool>& flush_right) {
  std::vector<std::size_t> width(flush_right.size(), 0);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  std::ostringstream out;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string fill(width[i] - row[i].size(), ' ');
      line += (i > 0 ? "  " : "") + (flush_right[i] ? fill + row[i] : row[i] + fill);
    }
    out << line.substr(0, line.find_last_not_of(' ') + 1) << '\n';
  }
  return out.str();
}

// What is counted of a session.
struct SessionFigures {
  int keyframes = 0, constraints = 0, failures = 0;
  double path_m = 0, duration_s = 0;
};

SessionFigures count_session(const SessionDocument& document, int session) {
  SessionFigures out;
  Timestamp first{0}, last{0};
  for (const SessionPose& pose : document.poses) {
    if (pose.key.session != session) continue;
    if (out.keyframes++ == 0) first = pose.time;
    last = pose.time;
    out.failures += pose.after_failure ? 1 : 0;
  }
  for (const auto& [of, constraint] : document.constraints) out.constraints += of == session ? 1 : 0;
  out.path_m = session_path_m(document, session);
  out.duration_s = to_seconds(last - first);
  return out;
}

std::string began_of(const SessionBeginnings& began, int session) {
  const auto found = began.find(session);
  return found == began.end() ? std::string() : found->second;
}

std::vector<const Encounter*> encounters_of(const SessionDocument& document, int session, EncounterState state) {
  std::vector<const Encounter*> out;
  for (const Encounter& e : document.encounters)
    if (e.state == state && (e.found.session == session || e.query.session == session)) out.push_back(&e);
  return out;
}

nlohmann::json number_json(double value) { return std::isnan(value) ? nlohmann::json() : nlohmann::json(value); }

nlohmann::json transform_json(const RigidTransform& T) {
  const Eigen::Quaterniond q = T.quaternion();
  return {T.t.x(), T.t.y(), T.t.z(), q.x(), q.y(), q.z(), q.w()};
}

nlohmann::json key_json(const PoseKey& key) { return {{"session", key.session}, {"keyframe", key.keyframe}}; }

nlohmann::json encounter_json(const Encounter& e) {
  return {{"id", e.id},
          {"state", to_string(e.state)},
          {"query", key_json(e.query)},
          {"found", key_json(e.found)},
          {"found_from_query", transform_json(e.found_from_query)},
          {"eta", number_json(e.bow)},
          {"crf_near", number_json(e.crf_near)},
          {"crf_far", number_json(e.crf_far)},
          {"matches", e.matches},
          {"inliers", e.inliers}};
}

// Standard deviations of an anchor: three metres, three degrees.
std::array<double, 6> anchor_sigmas(const SessionState& state) {
  std::array<double, 6> out{};
  for (int i = 0; i < 6; ++i)
    out[static_cast<std::size_t>(i)] =
        std::sqrt(std::max(0.0, state.anchor_covariance(i, i))) * (i < 3 ? 1 : kDegreesPerRadian);
  return out;
}

nlohmann::json summary_json(const SessionDocument& document, const SessionState& state,
                            const SessionBeginnings& began) {
  const SessionFigures counts = count_session(document, state.id);
  return {{"id", state.id},
          {"name", state.start.name},
          {"source", state.start.source},
          {"keyframes", counts.keyframes},
          {"constraints", counts.constraints},
          {"failures", counts.failures},
          {"path_m", counts.path_m},
          {"duration_s", counts.duration_s},
          {"started", began_of(began, state.id)},
          {"component", state.component},
          {"ended", state.ended}};
}

}  // namespace

std::string session_list_text(const SessionDocument& document, const SessionBeginnings& began) {
  if (document.sessions.empty()) return "no sessions\n";
  std::vector<std::vector<std::string>> rows{
      {"id", "name", "keyframes", "path m", "duration s", "started", "component", "ended", "source"}};
  for (const SessionState& state : document.sessions) {
    const SessionFigures counts = count_session(document, state.id);
    rows.push_back({std::to_string(state.id), state.start.name, std::to_string(counts.keyframes),
                    fixed_text(counts.path_m, 1), fixed_text(counts.duration_s, 1), began_of(began, state.id),
                    std::to_string(state.component), state.ended ? "yes" : "no", state.start.source});
  }
  return table_text(rows, {true, false, true, true, true, false, true, false, false});
}

nlohmann::json session_list_json(const SessionDocument& document, const SessionBeginnings& began) {
  nlohmann::json out = nlohmann::json::array();
  for (const SessionState& state : document.sessions) out.push_back(summary_json(document, state, began));
  return out;
}

std::string session_text(const SessionDocument& document, int session, const SessionBeginnings& began) {
  const SessionState& state = session_state(document, session);
  const SessionFigures counts = count_session(document, session);
  std::vector<std::vector<std::string>> rows;
  const auto row = [&](const std::string& what, const std::string& text) { rows.push_back({"  " + what, text}); };
  row("source", state.start.source);
  row("started", began_of(began, session) + (state.ended ? "" : ", has not ended"));
  row("camera", std::to_string(state.start.camera.width) + " x " + std::to_string(state.start.camera.height) +
                    ", focal length " + fixed_text(state.start.camera.focal_px.x(), 2) + " px, base line " +
                    fixed_text(state.start.camera.baseline_m, 4) + " m");
  row("poses", std::to_string(counts.keyframes) + ", " + fixed_text(counts.path_m, 2) + " m in " +
                   fixed_text(counts.duration_s, 1) + " s");
  row("constraints", std::to_string(counts.constraints));
  row("failures", std::to_string(counts.failures));
  std::string met;
  for (const SessionState& other : document.sessions)
    if (other.id != session && other.component == state.component) met += (met.empty() ? "" : ", ") + other.start.name;
  row("has met", met.empty() ? "no other session" : met);
  const Eigen::Vector3d& t = state.global_from_session.t;
  row("anchor", fixed_text(t.x(), 3) + " " + fixed_text(t.y(), 3) + " " + fixed_text(t.z(), 3) + " m, turned " +
                    fixed_text(state.global_from_session.angle() * kDegreesPerRadian, 2) +
                    " degrees, in the frame of session " + std::to_string(state.component));
  const auto sigma = anchor_sigmas(state);
  row("its sigma", fixed_text(sigma[0], 4) + " " + fixed_text(sigma[1], 4) + " " + fixed_text(sigma[2], 4) + " m, " +
                       fixed_text(sigma[3], 3) + " " + fixed_text(sigma[4], 3) + " " + fixed_text(sigma[5], 3) +
                       " degrees");
  for (const AttachedMap& map : document.maps)
    if (map.session == session)
      row("map", map.name + " (" + map.path + "), scale " + fixed_text(map.keyframe_from_map.s, 4) + ", " +
                     std::to_string(map.agreements) + " agreements");
  std::string out =
      state.start.name + " (session " + std::to_string(session) + "):\n" + table_text(rows, {false, false});
  for (const EncounterState kind : kEncounterStates) {
    const auto encounters = encounters_of(document, session, kind);
    if (encounters.empty()) continue;
    out += std::to_string(encounters.size()) + " encounters " + to_string(kind) + ":\n";
    for (const Encounter* e : encounters)
      out += "  " + std::to_string(e->id) + ": keyframe " + std::to_string(e->query.keyframe) + " of " +
             session_state(document, e->query.session).start.name + " saw keyframe " +
             std::to_string(e->found.keyframe) + " of " + session_state(document, e->found.session).start.name + '\n';
  }
  return out;
}

nlohmann::json session_json(const SessionDocument& document, int session, const SessionBeginnings& began) {
  const SessionState& state = session_state(document, session);
  nlohmann::json out = summary_json(document, state, began);
  const StereoCamera& camera = state.start.camera;
  out["camera"] = {{"width", camera.width},
                   {"height", camera.height},
                   {"focal_px", {camera.focal_px.x(), camera.focal_px.y()}},
                   {"centre_px", {camera.centre_px.x(), camera.centre_px.y()}},
                   {"baseline_m", camera.baseline_m},
                   {"frames_per_second", state.start.frames_per_second}};
  const auto sigma = anchor_sigmas(state);
  out["anchor"] = {{"global_from_session", transform_json(state.global_from_session)},
                   {"sigma_m", {sigma[0], sigma[1], sigma[2]}},
                   {"sigma_deg", {sigma[3], sigma[4], sigma[5]}}};
  nlohmann::json& poses = out["poses"] = nlohmann::json::array();
  for (const SessionPose& pose : document.poses)
    if (pose.key.session == session)
      poses.push_back({{"keyframe", pose.key.keyframe},
                       {"frame", pose.frame},
                       {"time_s", to_seconds(pose.time)},
                       {"after_failure", pose.after_failure},
                       {"session_from_camera", transform_json(pose.session_from_camera)}});
  nlohmann::json& encounters = out["encounters"] = nlohmann::json::object();
  for (const EncounterState kind : kEncounterStates) {
    nlohmann::json& list = encounters[to_string(kind)] = nlohmann::json::array();
    for (const Encounter* e : encounters_of(document, session, kind)) list.push_back(encounter_json(*e));
  }
  nlohmann::json& maps = out["maps"] = nlohmann::json::array();
  for (const AttachedMap& map : document.maps)
    if (map.session == session)
      maps.push_back({{"id", map.id},
                      {"name", map.name},
                      {"path", map.path},
                      {"scale", map.keyframe_from_map.s},
                      {"agreements", map.agreements}});
  return out;
}

std::string encounter_list_text(const SessionDocument& document) {
  if (document.encounters.empty()) return "no encounters\n";
  std::vector<std::vector<std::string>> rows{
      {"id", "state", "keyframe", "of", "saw", "of", "eta", "crf near", "crf far", "matches", "inliers"}};
  for (const Encounter& e : document.encounters)
    rows.push_back({std::to_string(e.id), to_string(e.state), std::to_string(e.query.keyframe),
                    session_state(document, e.query.session).start.name, std::to_string(e.found.keyframe),
                    session_state(document, e.found.session).start.name, fixed_text(e.bow, 3),
                    fixed_text(e.crf_near, 3), fixed_text(e.crf_far, 3), std::to_string(e.matches),
                    std::to_string(e.inliers)});
  return table_text(rows, {true, false, true, false, true, false, true, true, true, true, true});
}

nlohmann::json encounter_list_json(const SessionDocument& document) {
  nlohmann::json out = nlohmann::json::array();
  for (const Encounter& e : document.encounters) out.push_back(encounter_json(e));
  return out;
}

}  // namespace parallax
