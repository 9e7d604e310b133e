// The pose graph of a session database, built and solved outside a running back end.
//
// Plain functions; one thread.
#pragma once

#include <vector>

#include "sessions/session_database.h"
#include "sessions/session_graph.h"

namespace parallax {

// Sessions, constraints, and those encounters that are active, starting where the document has them. The graph is
// empty before.
void build_session_graph(const SessionDocument& document, SessionGraph* graph);

// Solves the graph as its encounters' states are, and writes poses and anchors. `changed`: encounters of the database
// with their new states (switched off or on), which are written in the same transaction. Throws what the database
// throws.
void reoptimise_sessions(SessionDatabase* database, const std::vector<Encounter>& changed = {});

}  // namespace parallax
