// Sessions that come into a database from another one, and sessions that go.
#include <algorithm>
#include <optional>

#include "core/check.h"
#include "core/error.h"
#include "sessions/session_database_parts.h"

namespace parallax {
namespace {

using session_file::Table;

// Numbers of the other database, and what they become.
struct Renumbering {
  std::map<int, int> session;
  std::int64_t encounters = 0, maps = 0;  // are added
};

// Copies the rows of a table; each is summed anew, because its numbers change.
void copy_rows(const Table& table, SqliteDatabase* from, SqliteDatabase* to, const Renumbering& renumbering) {
  const std::string columns = table.columns;
  std::string marks = "?";
  for (std::size_t i = 0; i < columns.size(); ++i) marks += ", ?";
  SqliteStatement select(from, "SELECT * FROM " + std::string(table.name));
  SqliteStatement insert(to, "INSERT INTO " + std::string(table.name) + " VALUES(" + marks + ")");
  while (select.next()) {
    std::string row_name;
    for (const char column : columns) {
      switch (column) {
        case 'S': {
          const std::int64_t session = select.take_integer();
          row_name += " session " + std::to_string(session);
          const auto renumbered = renumbering.session.find(static_cast<int>(session));
          insert.put(renumbered == renumbering.session.end() ? 0 : renumbered->second);
          break;
        }
        case 'K': {
          const std::int64_t keyframe = select.take_integer();
          row_name += " keyframe " + std::to_string(keyframe);
          insert.put(keyframe);
          break;
        }
        case 'E':
          insert.put(select.take_integer() + renumbering.encounters);
          break;
        case 'M':
          insert.put(select.take_integer() + renumbering.maps);
          break;
        case 'i':
          insert.put(select.take_integer());
          break;
        case 'n':
          insert.put(select.take_number());
          break;
        case 't':
          insert.put(select.take_text());
          break;
        default:
          insert.put(select.take_bytes());
          break;
      }
    }
    select.take_checksum();
    if (!select.row_is_sound())
      throw InputError(from->path() + ": " + table.name + ":" + row_name +
                       ": found damaged bytes, expected those of its checksum");
    insert.put_checksum().execute();
  }
}

// What the first keyframe of a session saw, as it is stored; none: it has no keyframe.
std::optional<std::vector<std::byte>> first_features(SqliteDatabase* database, int session) {
  const std::int64_t first =
      database->number("SELECT coalesce(min(keyframe), -1) FROM keyframe WHERE session = " + std::to_string(session));
  if (first < 0) return std::nullopt;
  return session_file::pack(session_file::Reader(database, false).features({session, static_cast<int>(first)}));
}

// The earliest session that each is connected with by encounters that are active.
std::map<int, int> components(const std::map<int, SessionState>& sessions, const std::vector<Encounter>& encounters) {
  std::map<int, int> parent;
  for (const auto& [id, state] : sessions) parent[id] = id;
  const auto root = [&](int id) {
    while (parent[id] != id) id = parent[id];
    return id;
  };
  for (const Encounter& e : encounters) {
    if (e.state != EncounterState::active || e.within_session()) continue;
    const int a = root(e.found.session), b = root(e.query.session);
    // They had not met in the estimates that are kept: an edge alone does not place one in the frame of the other.
    if (sessions.at(a).component != sessions.at(b).component) continue;
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::map<int, int> out;
  for (const auto& [id, state] : sessions) out[id] = root(id);
  return out;
}

}  // namespace

void SessionDatabase::expect_new_sessions(SessionDatabase* other) {
  PARALLAX_CHECK(other != this, "the sessions of a database are compared with those of another one");
  SqliteDatabase &here = implementation_->database, &there = other->implementation_->database;
  const session_file::SameState same_here(&here), same_there(&there);
  const std::vector<SessionState> known = session_file::Reader(&here, false).sessions();
  for (const SessionState& state : session_file::Reader(&there, false).sessions()) {
    const auto found = std::find_if(known.begin(), known.end(), [&](const SessionState& candidate) {
      return candidate.start.source == state.start.source && began(candidate.id) == other->began(state.id) &&
             first_features(&here, candidate.id) == first_features(&there, state.id);
    });
    if (found != known.end())
      throw InputError(other->path() + ": session '" + state.start.name + "' is in " + path() + " already, as '" +
                       found->start.name + "' (number " + std::to_string(found->id) +
                       "): found the same recording begun at the same time, expected sessions that " + path() +
                       " has not");
  }
}

std::vector<std::pair<int, int>> SessionDatabase::take(SessionDatabase* other) {
  PARALLAX_CHECK(other != this, "a database takes the sessions of another one");
  expect_new_sessions(other);
  Implementation& self = *implementation_;
  SqliteDatabase& from = other->implementation_->database;
  std::vector<std::pair<int, int>> out;
  const SessionDocument document = other->read();
  const session_file::SameState same(&from);
  self.in_transaction([&](Implementation::Index* index) {
    Renumbering renumbering;
    renumbering.encounters = index->numbers["next encounter"] - 1;
    renumbering.maps = index->numbers["next attached_map"] - 1;
    for (const SessionState& state : document.sessions) {
      const auto number = static_cast<int>(index->numbers["next session"]++);
      renumbering.session[state.id] = number;
      out.emplace_back(state.id, number);
    }
    for (SessionState state : document.sessions) {
      const std::string began_utc = other->began(state.id);
      state.id = renumbering.session.at(state.id);
      state.component = renumbering.session.at(state.component);
      state.start.name = self.unique_name(*index, state.start.name);
      self.put_session(state, began_utc);
      index->sessions[state.id] = state;
      index->began[state.id] = began_utc;
    }
    for (const SessionPose& pose : document.poses)
      index->keyframes.insert({renumbering.session.at(pose.key.session), pose.key.keyframe});
    for (const Encounter& e : document.encounters) {
      index->encounters.insert(e.id + renumbering.encounters);
      std::int64_t& next = index->numbers["next encounter"];
      next = std::max(next, e.id + renumbering.encounters + 1);
    }
    for (const AttachedMap& map : document.maps) {
      std::int64_t& next = index->numbers["next attached_map"];
      next = std::max(next, map.id + renumbering.maps + 1);
    }
    for (const Table& table : session_file::kTables)
      if (std::string(table.name) != "meta" && std::string(table.name) != "session")
        copy_rows(table, &from, &self.database, renumbering);
    self.recount(index);
  });
  return out;
}

void SessionDatabase::erase_session(int session) {
  Implementation& self = *implementation_;
  const SessionDocument document = read();
  self.in_transaction([&](Implementation::Index* index) {
    PARALLAX_CHECK(index->sessions.count(session) > 0, "a session of the database is erased");
    const std::string number = std::to_string(session);
    for (const char* table : {"keyframe", "pose", "feature", "image", "edge", "point", "timing", "attached_map"})
      self.database.run("DELETE FROM " + std::string(table) + " WHERE session = " + number);
    self.database.run("DELETE FROM encounter WHERE found_session = " + number + " OR query_session = " + number);
    self.database.run("DELETE FROM session WHERE id = " + number);

    std::vector<Encounter> encounters;
    for (const Encounter& e : document.encounters) {
      if (e.found.session == session || e.query.session == session)
        index->encounters.erase(e.id);
      else
        encounters.push_back(e);
    }
    index->keyframes.erase(index->keyframes.lower_bound({session, 0}), index->keyframes.lower_bound({session + 1, 0}));
    index->sessions.erase(session);
    index->began.erase(session);
    // What is left of its component has the frame of the earliest of its own.
    const std::map<int, int> component = components(index->sessions, encounters);
    std::map<int, RigidTransform> new_from_old;
    for (const auto& [id, state] : index->sessions)
      if (component.at(id) == id) new_from_old[id] = state.global_from_session.inverse();
    for (auto& [id, state] : index->sessions) {
      if (state.component == component.at(id)) continue;
      state.component = component.at(id);
      if (state.component == id) {
        state.global_from_session = {};
        state.anchor_covariance.setZero();
      } else {
        state.global_from_session = new_from_old.at(state.component) * state.global_from_session;
        state.global_from_session.orthonormalise();
      }
      self.put_session(state, index->began[id]);
    }
    self.recount(index);
  });
}

}  // namespace parallax
