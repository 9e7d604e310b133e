#include "sessions/session_graph.h"

#include <algorithm>

#include "core/check.h"

namespace parallax {

SessionGraph::SessionGraph(const SessionGraphOptions& options)
    : options_(options), held_(Matrix6d::Identity()), graph_(options.solver) {
  held_.topLeftCorner<3, 3>() *= options_.held_m * options_.held_m;
  held_.bottomRightCorner<3, 3>() *= options_.held_rad * options_.held_rad;
}

void SessionGraph::add_session(int session) {
  PARALLAX_CHECK(session > 0 && !sessions_.contains(session), "a session's number that is used already");
  Session& added = sessions_[session];
  added.component = session;
  added.anchor = graph_.add_pose({});
  added.anchor_prior = graph_.add_prior(added.anchor, {}, held_);
  added.poses.push_back(graph_.add_pose({}));
  graph_.add_prior(added.poses.back(), {}, held_);
}

bool SessionGraph::add_constraint(int session, const StereoConstraint& constraint) {
  Session& s = sessions_.at(session);
  if (constraint.to < static_cast<int>(s.poses.size())) return false;
  PARALLAX_CHECK(constraint.from + 1 == constraint.to && constraint.to == static_cast<int>(s.poses.size()),
                 "a constraint out of turn");
  RigidTransform start = graph_.pose(s.poses.back()) * constraint.from_from_to;
  start.orthonormalise();
  s.poses.push_back(graph_.add_pose(start));
  const int factor = graph_.add_constraint(s.poses[s.poses.size() - 2], s.poses.back(), constraint.from_from_to,
                                           constraint.covariance);
  PARALLAX_CHECK(factor >= 0, "a constraint that is no motion with a covariance");
  return true;
}

bool SessionGraph::contains(const PoseKey& key) const {
  return key.keyframe >= 0 && sessions_.contains(key.session) && key.keyframe < poses(key.session);
}

int SessionGraph::poses(int session) const { return static_cast<int>(sessions_.at(session).poses.size()); }

int SessionGraph::node(const PoseKey& key) const {
  PARALLAX_CHECK(contains(key), "a keyframe that is not in the graph");
  return sessions_.at(key.session).poses[static_cast<std::size_t>(key.keyframe)];
}

void SessionGraph::add_encounter(const Encounter& encounter) {
  PARALLAX_CHECK(!encounters_.contains(encounter.id), "an encounter's number that is used already");
  Edge edge;
  edge.a = encounter.found.session;
  edge.b = encounter.query.session;
  if (encounter.within_session()) {
    edge.factor = graph_.add_constraint(node(encounter.found), node(encounter.query), encounter.found_from_query,
                                        encounter.covariance, options_.kernel);
  } else {
    if (component(edge.a) != component(edge.b)) connect(encounter);
    edge.factor =
        graph_.add_encounter(sessions_.at(edge.a).anchor, node(encounter.found), sessions_.at(edge.b).anchor,
                             node(encounter.query), encounter.found_from_query, encounter.covariance, options_.kernel);
  }
  PARALLAX_CHECK(edge.factor >= 0, "an encounter that is no motion with a covariance");
  encounters_[encounter.id] = edge;
  if (component(edge.a) != component(edge.b)) find_components();
}

// The later component's anchors go to where the encounter puts them.
void SessionGraph::connect(const Encounter& encounter) {
  const bool query_moves = component(encounter.found.session) < component(encounter.query.session);
  const PoseKey& stays = query_moves ? encounter.found : encounter.query;
  const PoseKey& moves = query_moves ? encounter.query : encounter.found;
  const RigidTransform stays_from_moves =
      query_moves ? encounter.found_from_query : encounter.found_from_query.inverse();
  const RigidTransform new_from_old =
      global_from_camera(stays) * stays_from_moves * global_from_camera(moves).inverse();
  const int moving = component(moves.session);
  for (const auto& [number, session] : sessions_) {
    if (session.component != moving) continue;
    RigidTransform anchor = new_from_old * graph_.pose(session.anchor);
    anchor.orthonormalise();
    graph_.set_pose(session.anchor, anchor);
  }
}

void SessionGraph::set_active(std::int64_t encounter, bool active) {
  Edge& edge = encounters_.at(encounter);
  if (edge.active == active) return;
  edge.active = active;
  graph_.set_active(edge.factor, active);
  find_components();
}

double SessionGraph::encounter_error(std::int64_t encounter) const {
  return graph_.factor_error(encounters_.at(encounter).factor);
}

// Sessions joined by active encounters; the anchor of the earliest of each component is held, no other.
void SessionGraph::find_components() {
  std::map<int, int> earliest;
  for (const auto& [number, session] : sessions_) earliest[number] = number;
  const auto root = [&](int s) {
    while (earliest[s] != s) s = earliest[s] = earliest[earliest[s]];
    return s;
  };
  for (const auto& [id, edge] : encounters_) {
    if (!edge.active || edge.a == edge.b) continue;
    const int a = root(edge.a), b = root(edge.b);
    earliest[std::max(a, b)] = std::min(a, b);
  }
  std::map<int, RigidTransform> new_from_old;  // of parts that have come off: the earliest's own frame
  for (const auto& [number, session] : sessions_)
    if (root(number) == number && !graph_.active(session.anchor_prior))
      new_from_old[number] = graph_.pose(session.anchor).inverse();
  for (auto& [number, session] : sessions_) {
    session.component = root(number);
    const auto moved = new_from_old.find(session.component);
    if (moved != new_from_old.end()) graph_.set_pose(session.anchor, moved->second * graph_.pose(session.anchor));
    graph_.set_active(session.anchor_prior, session.component == number);
  }
}

const RigidTransform& SessionGraph::session_from_camera(const PoseKey& key) const { return graph_.pose(node(key)); }

void SessionGraph::set_pose(const PoseKey& key, const RigidTransform& session_from_camera) {
  graph_.set_pose(node(key), session_from_camera);
}

void SessionGraph::set_anchor(int session, const RigidTransform& global_from_session) {
  graph_.set_pose(sessions_.at(session).anchor, global_from_session);
}

const RigidTransform& SessionGraph::global_from_session(int session) const {
  return graph_.pose(sessions_.at(session).anchor);
}

int SessionGraph::component(int session) const { return sessions_.at(session).component; }

RigidTransform SessionGraph::global_from_camera(const PoseKey& key) const {
  return global_from_session(key.session) * session_from_camera(key);
}

// exp(d) anchor pose: with left increments of both, d = d_anchor + Ad(anchor) d_pose.
bool SessionGraph::covariance(const PoseKey& key, Matrix6d* covariance) const {
  const int nodes[2] = {sessions_.at(key.session).anchor, node(key)};
  Eigen::MatrixXd joint;
  if (!graph_.joint_marginal(nodes, &joint)) return false;
  Eigen::Matrix<double, 6, 12> both;
  both << Matrix6d::Identity(), global_from_session(key.session).adjoint();
  *covariance = both * joint * both.transpose();
  return true;
}

bool SessionGraph::anchor_covariance(int session, Matrix6d* covariance) const {
  return graph_.marginal(sessions_.at(session).anchor, covariance);
}

}  // namespace parallax
