#include "sessions/session_optimiser.h"

#include <algorithm>
#include <utility>

#include "core/check.h"

namespace parallax {

void build_session_graph(const SessionDocument& document, SessionGraph* graph) {
  for (const SessionState& state : document.sessions) graph->add_session(state.id);
  for (const auto& [session, constraint] : document.constraints) graph->add_constraint(session, constraint);
  // Encounters first, which join what has met; then all start where they were left.
  for (const Encounter& encounter : document.encounters)
    if (encounter.state == EncounterState::active && graph->contains(encounter.found) &&
        graph->contains(encounter.query))
      graph->add_encounter(encounter);
  for (const SessionState& state : document.sessions)
    if (state.component == graph->component(state.id)) graph->set_anchor(state.id, state.global_from_session);
  for (const SessionPose& pose : document.poses)
    if (graph->contains(pose.key)) graph->set_pose(pose.key, pose.session_from_camera);
}

void reoptimise_sessions(SessionDatabase* database, const std::vector<Encounter>& changed) {
  SessionDocument document = database->read();
  if (document.sessions.empty()) return;
  for (const Encounter& encounter : changed) {
    const auto there = std::find_if(document.encounters.begin(), document.encounters.end(),
                                    [&](const Encounter& e) { return e.id == encounter.id; });
    PARALLAX_CHECK(there != document.encounters.end(), "an encounter of the database changes");
    *there = encounter;
  }
  SessionGraph graph;
  build_session_graph(document, &graph);
  graph.optimise();
  SessionBatch batch;
  batch.session = document.sessions.front().id;
  batch.encounters = changed;
  for (const SessionPose& pose : document.poses) {
    if (!graph.contains(pose.key)) continue;
    batch.moved.push_back(pose);
    batch.moved.back().session_from_camera = graph.session_from_camera(pose.key);
  }
  for (SessionState state : document.sessions) {
    state.component = graph.component(state.id);
    state.global_from_session = graph.global_from_session(state.id);
    if (!graph.anchor_covariance(state.id, &state.anchor_covariance)) state.anchor_covariance.setZero();
    batch.states.push_back(std::move(state));
  }
  database->save(batch);
}

}  // namespace parallax
