// Sessions made by hand, as run_slam_sessions() would have left them: two that have met and one that has not, with
// times that are easily summed.
#pragma once

#include <cmath>
#include <string>

#include "app/slam_sessions.h"

namespace parallax::testing {

struct MadeSession {
  std::string name;
  int poses = 40;
  int component = 1;
  RigidTransform global_from_session;
  double radius_m = 4;
};

// Poses of a session: around a circle on the ground (world y down), a fifth of a metre and a quarter of a second apart.
inline RigidTransform made_pose(const MadeSession& session, int keyframe) {
  const double turn = 0.2 / session.radius_m * keyframe;
  const Eigen::Vector3d place(session.radius_m * (1 - std::cos(turn)), -0.01 * keyframe,
                              session.radius_m * std::sin(turn));
  return {exp_so3({0, turn, 0}), place};
}

inline Matrix6d made_covariance(double sigma_m, double sigma_rad) {
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(sigma_m * sigma_m), Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
  return variances.asDiagonal();
}

inline Encounter made_encounter(std::int64_t id, const PoseKey& found, const PoseKey& query, EncounterState state,
                                const SlamSessionsResult& run) {
  const auto global = [&](const PoseKey& key) {
    for (const SessionPose& pose : run.view.poses)
      if (pose.key == key)
        return run.view.sessions[static_cast<std::size_t>(key.session - 1)].global_from_session *
               pose.session_from_camera;
    return RigidTransform();
  };
  Encounter out;
  out.id = id;
  out.found = found;
  out.query = query;
  out.found_from_query = global(found).inverse() * global(query);
  out.covariance = made_covariance(0.02, 0.005);
  out.bow = 0.5;
  out.crf_near = 1.25;
  out.matches = 90;
  out.inliers = 60;
  out.state = state;
  return out;
}

// Sessions 1, 2... with keyframe k in frame 5 k at 0.25 k seconds (of session s from second 1000 s on). Front end: 10 +
// f % 3 ms and 4 ms a frame; a window's keyframe 20 + k ms, place recognition 30 + k ms, the pose graph every 10
// keyframes k ms, with a loop at 20.
inline SlamSessionsResult made_run(const std::vector<MadeSession>& sessions) {
  SlamSessionsResult run;
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    const MadeSession& made = sessions[s];
    const int id = static_cast<int>(s) + 1;
    SlamSessionOutcome outcome;
    outcome.state.id = id;
    outcome.state.start.name = made.name;
    outcome.state.start.source = "recordings/" + made.name;
    outcome.state.component = made.component;
    outcome.state.global_from_session = made.global_from_session;
    SlamLinkPart part;
    part.state = outcome.state;
    outcome.parts.push_back(part);
    outcome.result.frames_read = 5 * made.poses;
    outcome.result.frames_dropped = id;
    for (int k = 0; k < made.poses; ++k) {
      const RigidTransform pose = made_pose(made, k);
      const Timestamp time = from_seconds(1000.0 * id + 0.25 * k);
      outcome.result.keyframes.push_back({5 * k, time, pose});
      run.view.poses.push_back({{id, k}, 5 * k, time, false, pose});
      outcome.result.points.push_back({pose * Eigen::Vector3d(0.5, 0.2, 2), 3, k});
      if (k > 0)
        outcome.result.constraints.push_back(
            {k - 1, k, made_pose(made, k - 1).inverse() * pose, made_covariance(0.01, 0.002), false});
      for (int f = 5 * k; f < 5 * k + 5; ++f) {
        run.timings.push_back({{id, f}, SessionModule::feature_tracking, 10.0 + f % 3, false});
        run.timings.push_back({{id, f}, SessionModule::stereo_odometry, 4.0, false});
      }
      run.timings.push_back({{id, k}, SessionModule::window, 20.0 + k, false});
      run.timings.push_back({{id, k}, SessionModule::place_recognition, 30.0 + k, false});
      if (k % 10 == 0 && k > 0) run.timings.push_back({{id, k}, SessionModule::pose_graph, 1.0 * k, k == 20});
    }
    outcome.before = outcome.result.keyframes;
    run.view.sessions.push_back(outcome.state);
    run.sessions.push_back(std::move(outcome));
  }
  return run;
}

// "hall" and "stairs & <b>" have met in three places, hall closes a loop, "yard" is elsewhere.
inline SlamSessionsResult made_run() {
  const RigidTransform aside(exp_so3({0, 0.3, 0}), {1, 0.1, 2});
  SlamSessionsResult run =
      made_run({{"hall", 125, 1, {}, 4}, {"stairs & <b>", 80, 1, aside, 6}, {"yard", 60, 3, {}, 3}});
  auto& encounters = run.view.encounters;
  encounters.push_back(made_encounter(1, {1, 0}, {1, 124}, EncounterState::active, run));
  encounters.push_back(made_encounter(2, {1, 10}, {2, 5}, EncounterState::active, run));
  encounters.push_back(made_encounter(3, {1, 14}, {2, 9}, EncounterState::active, run));
  encounters.push_back(made_encounter(4, {1, 30}, {2, 40}, EncounterState::active, run));
  encounters.push_back(made_encounter(5, {1, 60}, {2, 70}, EncounterState::waiting, run));
  encounters.push_back(made_encounter(6, {3, 2}, {3, 50}, EncounterState::refused, run));
  PlaceEncounter refused;
  refused.refused = "too few inliers";
  run.refused = {refused, refused};
  run.sessions[1].result.warnings.push_back({7, "frame 7: \"dark\" & <odd>"});
  return run;
}

}  // namespace parallax::testing
