// The pose graph of a session database, built and solved outside a running back end.
//
// Plain functions; one thread.
#pragma once

#include "sessions/session_database.h"
#include "sessions/session_graph.h"

namespace parallax {

// Sessions, constraints, and those encounters that are active, starting where the document has them. The graph is
// empty before.
void build_session_graph(const SessionDocument& document, SessionGraph* graph);

// Solves the graph as its encounters' states are, and writes poses and anchors: after encounters have been switched off
// or on. Throws what the database throws.
void reoptimise_sessions(SessionDatabase* database);

}  // namespace parallax
