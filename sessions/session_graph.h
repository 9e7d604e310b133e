// The pose graphs of all sessions in one (MS §3.2, §4.2): every session keeps its own frame and its own poses; an
// anchor tells where that frame lies in the global one, and an encounter between two sessions ties two poses through
// their anchors (Eq. 6; Kim et al. 2010). Constraints within a session know no anchor.
//
// Sessions that have met form a component; its global frame is that of its earliest session, whose anchor is held.
// Not thread-safe: one worker steps it.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "core/interruption.h"
#include "sessions/session_types.h"
#include "solver/incremental_pose_graph.h"

namespace parallax {

struct SessionGraphOptions {
  IncrementalPoseGraphOptions solver;
  RobustKernel kernel = RobustKernel::huber;  // of encounters
  // Holds a session's first keyframe in the session's frame, and a component's first anchor in the global one.
  double held_m = 1e-4, held_rad = 1e-4;
};

class SessionGraph {
 public:
  explicit SessionGraph(const SessionGraphOptions& options = {});

  // Numbers above 0, each once.
  void add_session(int session);
  bool has_session(int session) const { return sessions_.contains(session); }
  // Constraints of a session come in order; one that is there already is passed over (false).
  bool add_constraint(int session, const StereoConstraint& constraint);
  bool contains(const PoseKey& key) const;
  int poses(int session) const;  // keyframes 0 to this are in the graph

  // Both keyframes are in the graph. Joins the components of two sessions: the later component is moved.
  void add_encounter(const Encounter& encounter);
  bool has_encounter(std::int64_t id) const { return encounters_.contains(id); }
  // Undo and redo. A component that falls apart has a global frame for each part then.
  void set_active(std::int64_t encounter, bool active);
  // Squared Mahalanobis distance of an encounter from the estimate.
  double encounter_error(std::int64_t encounter) const;

  // One incremental step with what is new; all to convergence.
  PoseGraphStep update(const Interruption& stop = {}) { return graph_.update(stop); }
  PoseGraphStep optimise(const Interruption& stop = {}) { return graph_.optimise(stop); }

  const RigidTransform& session_from_camera(const PoseKey& key) const;
  // A start value from elsewhere (a database), before the next step.
  void set_pose(const PoseKey& key, const RigidTransform& session_from_camera);
  void set_anchor(int session, const RigidTransform& global_from_session);
  const RigidTransform& global_from_session(int session) const;
  int component(int session) const;  // the number of its earliest session
  RigidTransform global_from_camera(const PoseKey& key) const;
  // Of a left increment of global_from_camera, translation first; the anchor's and the pose's share together. False
  // when nothing ties it down.
  bool covariance(const PoseKey& key, Matrix6d* covariance) const;
  bool anchor_covariance(int session, Matrix6d* covariance) const;

  const IncrementalPoseGraph& solver() const { return graph_; }

 private:
  struct Session {
    int anchor = -1, anchor_prior = -1, component = 0;
    std::vector<int> poses;  // nodes by keyframe
  };
  struct Edge {
    int factor = -1, a = 0, b = 0;  // sessions
    bool active = true;
  };
  int node(const PoseKey& key) const;
  void connect(const Encounter& encounter);
  void find_components();

  SessionGraphOptions options_;
  Matrix6d held_;
  IncrementalPoseGraph graph_;
  std::map<int, Session> sessions_;
  std::map<std::int64_t, Edge> encounters_;
};

}  // namespace parallax
