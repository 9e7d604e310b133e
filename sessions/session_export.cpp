#include "sessions/session_export.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>
#include <set>

#include "core/check.h"

namespace parallax {
namespace {

// Poses of one session: they lie together, by keyframe.
std::pair<std::vector<SessionPose>::const_iterator, std::vector<SessionPose>::const_iterator> poses_of(
    const SessionDocument& document, int session) {
  const auto before = [](const SessionPose& pose, int number) { return pose.key.session < number; };
  return {std::lower_bound(document.poses.begin(), document.poses.end(), session, before),
          std::lower_bound(document.poses.begin(), document.poses.end(), session + 1, before)};
}

}  // namespace

// mu = Ad nu, and nu is twice the quaternion's vector.
Matrix6d g2o_information(const RigidTransform& from_from_to, const Matrix6d& covariance) {
  Matrix6d left_from_g2o = from_from_to.adjoint();
  left_from_g2o.rightCols<3>() *= 2;
  const Matrix6d information = left_from_g2o.transpose() * covariance.llt().solve(left_from_g2o);
  return (information + information.transpose()) / 2;
}

const SessionState& session_state(const SessionDocument& document, int session) {
  const auto found = std::find_if(document.sessions.begin(), document.sessions.end(),
                                  [&](const SessionState& state) { return state.id == session; });
  PARALLAX_CHECK(found != document.sessions.end(), "session " + std::to_string(session) + " is not in the database");
  return *found;
}

Trajectory session_trajectory(const SessionDocument& document, int session, SessionFrame frame) {
  const SessionState& state = session_state(document, session);
  const RigidTransform world_from_session =
      frame == SessionFrame::global ? state.global_from_session : RigidTransform();
  Trajectory out;
  const auto [begin, end] = poses_of(document, session);
  for (auto pose = begin; pose != end; ++pose)
    out.push_back({pose->time, world_from_session * pose->session_from_camera * state.start.rectified_from_left});
  return out;
}

GraphFile session_graph_file(const SessionDocument& document, const std::vector<int>& sessions) {
  GraphFile out;
  std::map<PoseKey, std::int64_t> vertex;
  std::set<int> components;
  const std::set<int> wanted(sessions.begin(), sessions.end());
  for (const int session : wanted) {
    const SessionState& state = session_state(document, session);
    const auto [begin, end] = poses_of(document, session);
    for (auto pose = begin; pose != end; ++pose) {
      const auto id = static_cast<std::int64_t>(out.vertices.size());
      vertex[pose->key] = id;
      out.vertices.push_back({id, state.global_from_session * pose->session_from_camera});
      if (components.insert(state.component).second) out.fixed.push_back(id);
    }
  }
  const auto add = [&](const PoseKey& from, const PoseKey& to, const RigidTransform& from_from_to,
                       const Matrix6d& covariance) {
    const auto a = vertex.find(from), b = vertex.find(to);
    if (a != vertex.end() && b != vertex.end())
      out.edges.push_back({a->second, b->second, from_from_to, g2o_information(from_from_to, covariance)});
  };
  for (const auto& [session, c] : document.constraints)
    add({session, c.from}, {session, c.to}, c.from_from_to, c.covariance);
  for (const Encounter& e : document.encounters)
    if (e.state == EncounterState::active) add(e.found, e.query, e.found_from_query, e.covariance);
  return out;
}

std::vector<SessionCloudPoint> session_cloud(const SessionDocument& document, int session,
                                             const std::vector<SessionPoint>& points) {
  const SessionState& state = session_state(document, session);
  const auto [begin, end] = poses_of(document, session);
  std::vector<SessionCloudPoint> out;
  out.reserve(points.size());
  for (const SessionPoint& p : points) {
    const auto pose = std::lower_bound(begin, end, p.keyframe, [](const SessionPose& candidate, int keyframe) {
      return candidate.key.keyframe < keyframe;
    });
    if (pose == end || pose->key.keyframe != p.keyframe) continue;
    out.push_back({session, p.keyframe, p.poses,
                   state.global_from_session * (pose->session_from_camera * p.camera.cast<double>())});
  }
  return out;
}

std::array<std::uint8_t, 3> cloud_colour_of(int session) {
  // Okabe and Ito's colours, told apart by the colour-blind too, black replaced by grey.
  static constexpr std::array<std::array<std::uint8_t, 3>, 8> kColours{{{0, 114, 178},
                                                                        {213, 94, 0},
                                                                        {0, 158, 115},
                                                                        {204, 121, 167},
                                                                        {230, 159, 0},
                                                                        {86, 180, 233},
                                                                        {240, 228, 66},
                                                                        {120, 120, 120}}};
  return kColours[static_cast<std::size_t>(std::max(session, 1) - 1) % kColours.size()];
}

double session_path_m(const SessionDocument& document, int session) {
  const auto [begin, end] = poses_of(document, session);
  double length = 0;
  for (auto pose = begin; pose != end; ++pose)
    if (pose != begin && !pose->after_failure)
      length += (pose->session_from_camera.t - std::prev(pose)->session_from_camera.t).norm();
  return length;
}

}  // namespace parallax
