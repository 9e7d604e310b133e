// What `parallax sessions` says about a session database, as text and as JSON. Plain functions.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "sessions/session_database.h"

namespace parallax {

// `began`: of each session, UTC.
using SessionBeginnings = std::map<int, std::string>;

// A row a session.
std::string session_list_text(const SessionDocument& document, const SessionBeginnings& began);
nlohmann::json session_list_json(const SessionDocument& document, const SessionBeginnings& began);

// All about one: poses, constraints, failures, encounters by state, anchor, attached maps.
std::string session_text(const SessionDocument& document, int session, const SessionBeginnings& began);
nlohmann::json session_json(const SessionDocument& document, int session, const SessionBeginnings& began);

// A row an encounter with its provenance (MS Eq. 4 and 5).
std::string encounter_list_text(const SessionDocument& document);
nlohmann::json encounter_list_json(const SessionDocument& document);

}  // namespace parallax
