#include "app/session_view_scene.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace parallax {
namespace {

constexpr double kChiSquare95 = 5.991464547107979;  // two degrees of freedom
constexpr CanvasColour kSessionPalette[] = {{0, 114, 178}, {230, 159, 0}, {0, 158, 115}, {86, 180, 233}, {70, 70, 70}};
constexpr std::array<std::uint8_t, 3> kFeatureGrey{110, 110, 110};

bool has_pose(const SceneSession& session, int keyframe) {
  return keyframe >= 0 && keyframe < static_cast<int>(session.poses.size());
}

}  // namespace

double SceneSession::path_m() const {
  double length = 0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    length += (poses[i].global_from_camera.t - poses[i - 1].global_from_camera.t).norm();
  return length;
}

double SceneSession::seconds_of_frame(int frame) const {
  if (poses.empty()) return 0;
  const auto after =
      std::upper_bound(poses.begin(), poses.end(), frame, [](int f, const ScenePose& pose) { return f < pose.frame; });
  if (after == poses.begin()) return poses.front().seconds;
  const ScenePose& before = *(after - 1);
  if (after == poses.end()) return before.seconds;
  return before.seconds + (after->seconds - before.seconds) * (frame - before.frame) / (after->frame - before.frame);
}

const SceneSession* SessionScene::session(int id) const {
  const auto found = std::lower_bound(sessions.begin(), sessions.end(), id,
                                      [](const SceneSession& s, int number) { return s.id < number; });
  return found != sessions.end() && found->id == id ? &*found : nullptr;
}

const ScenePose* SessionScene::pose(const PoseKey& key) const {
  const SceneSession* of = session(key.session);
  return of != nullptr && has_pose(*of, key.keyframe) ? &of->poses[static_cast<std::size_t>(key.keyframe)] : nullptr;
}

std::vector<SessionScene> SessionScene::components() const {
  std::map<int, SessionScene> by_component;
  for (const SceneSession& s : sessions)
    if (!s.poses.empty()) by_component[s.component].sessions.push_back(s);
  std::vector<SessionScene> out;
  for (auto& [number, scene] : by_component) {
    for (const SceneLink& link : links)
      if (scene.pose(link.found) != nullptr && scene.pose(link.query) != nullptr) scene.links.push_back(link);
    for (const SceneSpread& spread : spreads)
      if (scene.pose(spread.key) != nullptr) scene.spreads.push_back(spread);
    out.push_back(std::move(scene));
  }
  return out;
}

SessionScene SessionScene::only(int id) const {
  SessionScene out;
  if (const SceneSession* of = session(id)) out.sessions.push_back(*of);
  for (const SceneLink& link : links)
    if (link.found.session == id && link.query.session == id) out.links.push_back(link);
  for (const SceneSpread& spread : spreads)
    if (spread.key.session == id) out.spreads.push_back(spread);
  return out;
}

SessionScene make_session_scene(const BackEndView& view) {
  SessionScene out;
  std::map<int, const SessionState*> states;
  for (const SessionState& state : view.sessions) states[state.id] = &state;
  for (const auto& [id, state] : states) {
    SceneSession session;
    session.id = id;
    session.component = state->component;
    session.name = state->start.name;
    session.colour = session_colour(static_cast<int>(out.sessions.size()));
    out.sessions.push_back(std::move(session));
  }
  std::map<int, Timestamp> began;
  for (const SessionPose& pose : view.poses) {
    const auto state = states.find(pose.key.session);
    if (state == states.end()) continue;
    SceneSession& session = out.sessions[static_cast<std::size_t>(std::distance(states.begin(), state))];
    if (pose.key.keyframe != static_cast<int>(session.poses.size())) continue;  // what follows a gap hangs on nothing
    const Timestamp begin = began.try_emplace(pose.key.session, pose.time).first->second;
    session.poses.push_back({pose.key.keyframe, pose.frame, to_seconds(pose.time - begin), pose.after_failure,
                             state->second->global_from_session * pose.session_from_camera});
  }
  for (const Encounter& encounter : view.encounters)
    if (encounter.state == EncounterState::active && out.pose(encounter.found) != nullptr &&
        out.pose(encounter.query) != nullptr)
      out.links.push_back({encounter.found, encounter.query});
  return out;
}

Eigen::Matrix3d place_covariance(const Matrix6d& covariance, const Eigen::Vector3d& place) {
  Eigen::Matrix<double, 3, 6> place_from_increment;
  place_from_increment << Eigen::Matrix3d::Identity(), -hat(place);
  return place_from_increment * covariance * place_from_increment.transpose();
}

void add_spreads(const SessionGraph& graph, int most_a_session, SessionScene* scene) {
  for (const SceneSession& session : scene->sessions) {
    std::set<int> chosen;
    const int last = static_cast<int>(session.poses.size()) - 1;
    for (int i = 1; i <= most_a_session && last >= 0; ++i) chosen.insert(last * i / most_a_session);
    for (const int keyframe : chosen) {
      const PoseKey key{session.id, keyframe};
      Matrix6d covariance;
      if (!graph.has_session(session.id) || !graph.contains(key) || !graph.covariance(key, &covariance)) continue;
      scene->spreads.push_back({key, place_covariance(covariance, graph.global_from_camera(key).t)});
    }
  }
}

void add_feature_points(int id, const std::vector<SessionPoint>& points, std::size_t most, SessionScene* scene) {
  for (SceneSession& session : scene->sessions) {
    if (session.id != id || most == 0) continue;
    const std::size_t step = (points.size() + most - 1) / most;
    for (std::size_t i = 0; i < points.size(); i += std::max<std::size_t>(step, 1)) {
      if (!has_pose(session, points[i].keyframe)) continue;
      const RigidTransform& pose = session.poses[static_cast<std::size_t>(points[i].keyframe)].global_from_camera;
      const Eigen::Vector3d place = pose * points[i].camera.cast<double>();
      session.points.push_back({place.cast<float>(), kFeatureGrey, 0});
    }
  }
}

Eigen::Matrix2d ellipse_95(const Eigen::Matrix2d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(0.5 * (covariance + covariance.transpose()));
  return axes.eigenvectors() * (kChiSquare95 * axes.eigenvalues().cwiseMax(0)).cwiseSqrt().asDiagonal();
}

CanvasColour session_colour(int n) {
  constexpr int kColours = static_cast<int>(std::size(kSessionPalette));
  CanvasColour colour = kSessionPalette[std::max(0, n) % kColours];
  for (int darker = std::max(0, n) / kColours; darker > 0; --darker)
    colour = {colour.red * 5 / 8, colour.green * 5 / 8, colour.blue * 5 / 8};
  return colour;
}

}  // namespace parallax
