#include "app/session_outputs.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <map>
#include <sstream>

#include "core/file_io.h"
#include "sessions/session_schema.h"

namespace parallax {
namespace {

Timestamp joint_offset(std::size_t session) { return from_seconds(1e6 * static_cast<double>(session)); }

void append_later(const Trajectory& trajectory, std::size_t session, Trajectory* out) {
  for (TrajectoryPose pose : trajectory) {
    pose.time += joint_offset(session);
    out->push_back(pose);
  }
}

// Where a keyframe of this run really was: of the rectified left camera, in the frame of the source's true poses.
const RigidTransform* true_pose(const std::map<PoseKey, RigidTransform>& truth, int session, int keyframe) {
  const auto found = truth.find({session, keyframe});
  return found == truth.end() ? nullptr : &found->second;
}

std::map<PoseKey, RigidTransform> true_poses(const SlamSessionsResult& run) {
  std::map<PoseKey, RigidTransform> out;
  for (const SlamSessionOutcome& session : run.sessions) {
    std::map<std::int64_t, const RigidTransform*> at;
    for (const TrajectoryPose& pose : session.truth) at[pose.time.count()] = &pose.world_from_camera;
    std::size_t part = 0;
    for (std::size_t local = 0; local < session.result.keyframes.size(); ++local) {
      while (part + 1 < session.parts.size() && session.parts[part + 1].first_local <= static_cast<int>(local)) ++part;
      const auto found = at.find(session.result.keyframes[local].time.count());
      if (found == at.end() || session.parts.empty()) continue;
      const SlamLinkPart& of = session.parts[part];
      out[{of.state.id, of.keyframe_of(static_cast<int>(local))}] =
          *found->second * session.result.rectified_from_left.inverse();
    }
  }
  return out;
}

}  // namespace

const char* to_string(EncounterState state) { return session_file::name_of(state); }

void write_joint_trajectory(const SlamSessionsResult& run, const std::string& path) {
  Trajectory all;
  for (std::size_t k = 0; k < run.sessions.size(); ++k) append_later(run.sessions[k].global_trajectory(), k, &all);
  write_trajectory_tum(all, path);
}

void write_joint_truth(const SlamSessionsResult& run, const std::string& path) {
  Trajectory all;
  for (std::size_t k = 0; k < run.sessions.size(); ++k) append_later(run.sessions[k].truth, k, &all);
  write_trajectory_tum(all, path);
}

void write_encounters_csv(const SlamSessionsResult& run, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << "id,state,query_session,query_keyframe,found_session,found_keyframe,eta,crf_near,crf_far,matches,inliers,"
           "tx,ty,tz,qx,qy,qz,qw,sigma_m,sigma_rad,error_m,error_rad,refused\n"
        << std::setprecision(9);
    const std::map<PoseKey, RigidTransform> truth = true_poses(run);
    const auto row = [&](const auto& e, const std::string& id, const char* state, const std::string& refused) {
      const Eigen::Quaterniond q = e.found_from_query.quaternion();
      out << id << ',' << state << ',' << e.query.session << ',' << e.query.keyframe << ',' << e.found.session << ','
          << e.found.keyframe << ',' << e.bow << ',' << e.crf_near << ',' << e.crf_far << ',' << e.matches << ','
          << e.inliers << ',' << e.found_from_query.t.x() << ',' << e.found_from_query.t.y() << ','
          << e.found_from_query.t.z() << ',' << q.x() << ',' << q.y() << ',' << q.z() << ',' << q.w() << ','
          << std::sqrt(e.covariance.template topLeftCorner<3, 3>().trace()) << ','
          << std::sqrt(e.covariance.template bottomRightCorner<3, 3>().trace()) << ',';
      const RigidTransform* query = true_pose(truth, e.query.session, e.query.keyframe);
      const RigidTransform* found = true_pose(truth, e.found.session, e.found.keyframe);
      if (query && found) {
        const RigidTransform off = found->inverse() * *query * e.found_from_query.inverse();
        out << off.t.norm() << ',' << off.angle();
      } else {
        out << ',';
      }
      out << ',' << refused << '\n';
    };
    for (const Encounter& e : run.view.encounters) row(e, std::to_string(e.id), to_string(e.state), "");
    for (const PlaceEncounter& e : run.refused) {
      std::string why = e.refused;
      std::replace(why.begin(), why.end(), ',', ';');
      row(e, "", "no place", why);
    }
  });
}

std::string meetings_text(const SlamSessionsResult& run) {
  std::ostringstream out;
  std::map<EncounterState, int> within, between;
  for (const Encounter& e : run.view.encounters) ++(e.within_session() ? within : between)[e.state];
  const auto line = [&](const char* what, std::map<EncounterState, int>& count) {
    if (count.empty()) return;
    out << what << ": " << count[EncounterState::active] << " in the graph, " << count[EncounterState::waiting]
        << " not confirmed, " << count[EncounterState::refused] << " refused";
    if (count[EncounterState::off] > 0) out << ", " << count[EncounterState::off] << " switched off";
    out << '\n';
  };
  line("loops within sessions", within);
  line("encounters between sessions", between);
  for (const SlamSessionOutcome& session : run.sessions)
    for (const auto& [e, other] : session.meetings) {
      const auto part_with = [&](const PoseKey& key) {
        return std::find_if(session.parts.begin(), session.parts.end(),
                            [&](const SlamLinkPart& part) { return part.state.id == key.session; });
      };
      const bool is_query = part_with(e.query) != session.parts.end();
      const PoseKey &here = is_query ? e.query : e.found, &there = is_query ? e.found : e.query;
      const auto part = part_with(here);
      const SessionState& own = part == session.parts.end() ? session.state : part->state;
      out << own.start.name << " met " << other << " at its pose " << here.keyframe << " (pose " << there.keyframe
          << " of the other)\n";
    }
  std::map<int, int> sessions_in;  // a component
  for (const SessionState& state : run.view.sessions) ++sessions_in[state.component];
  for (const SessionState& state : run.view.sessions)
    if (sessions_in.size() > 1 && sessions_in[state.component] == 1)
      out << state.start.name << " has met no other session: it has a frame of its own\n";
  // As the sessions' own tables (MS Table 2).
  for (const auto& [module, label] :
       {std::pair{SessionModule::place_recognition, "place recognition"}, {SessionModule::pose_graph, "pose graph"}}) {
    double sum = 0, squares = 0, worst = 0;
    int count = 0;
    for (const SessionTiming& t : run.timings) {
      if (t.module != module) continue;
      sum += t.ms;
      squares += t.ms * t.ms;
      worst = std::max(worst, t.ms);
      ++count;
    }
    if (count == 0) continue;
    const double mean = sum / count;
    out << std::fixed << std::setprecision(2) << std::left << std::setw(20) << label << std::right << std::setw(9)
        << mean << std::setw(11) << std::max(0.0, squares / count - mean * mean) << std::setw(10) << worst << '\n';
  }
  return out.str();
}

}  // namespace parallax
