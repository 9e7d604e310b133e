// Reading a session database: nothing in it is believed.
#include <algorithm>
#include <limits>
#include <utility>

#include "core/error.h"
#include "map/map_file.h"
#include "map/map_file_schema.h"
#include "sessions/session_database_parts.h"

namespace parallax {
namespace session_file {
namespace {

constexpr const char* kDamaged = "found damaged bytes, expected those of its checksum";

}  // namespace

std::string to_text(const RawKey& key) {
  return "session " + std::to_string(key.session) + ", keyframe " + std::to_string(key.keyframe);
}

std::string to_text(const PoseKey& key) { return to_text(RawKey{key.session, key.keyframe}); }

SameState::SameState(SqliteDatabase* database) : database_(database) { database_->run("BEGIN"); }

SameState::~SameState() {
  try {
    database_->run("END");
  } catch (const std::exception&) {  // nothing was written
  }
}

void check_version(SqliteDatabase* database) {
  const std::int64_t mark = database->number("PRAGMA application_id");
  if (mark != kApplicationId)
    throw InputError(database->path() + ": found " +
                     (mark == map_file::kApplicationId ? "a map file" : "another program's database") +
                     ", expected a session database");
  const std::int64_t version = database->number("PRAGMA user_version");
  if (version < 1 || version > SessionDatabase::kVersion)
    throw InputError(database->path() + ": found a session database of version " + std::to_string(version) +
                     ", expected at most " + std::to_string(SessionDatabase::kVersion));
}

void Reader::problem(const std::string& text) {
  if (!all_) throw InputError(database_->path() + ": " + text);
  if (problems_.size() < kMostProblems) problems_.push_back(text);
}

void Reader::rows(const std::string& table, const std::string& query, const std::vector<std::int64_t>& values,
                  const Take& take) {
  const auto failed = [&](const std::string& what) {
    // What a connection that may write says of a page that it cannot read.
    const std::string reason = what.substr(std::min(what.size(), database_->path().size() + 2));
    const std::string wrong = "cannot be written: ";
    problem(table + ": " + (reason.rfind(wrong, 0) == 0 ? "cannot be read: " + reason.substr(wrong.size()) : reason));
  };
  try {
    SqliteStatement statement(database_, query);
    for (const std::int64_t value : values) statement.put(value);
    while (statement.next()) {
      std::string name = table;
      const std::string wrong = take(&statement, &name);
      if (!statement.row_is_sound())
        problem(name + ": " + kDamaged);
      else if (!wrong.empty())
        problem(name + ": " + wrong);
    }
  } catch (const RunError& e) {
    failed(e.what());
  } catch (const InputError& e) {
    if (!all_) throw;
    failed(e.what());
  }
}

// The tables, and nothing else: what is not ours may do what it likes when it is read.
void Reader::check_tables() {
  const std::vector<std::string> found =
      database_->texts("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name", 100);
  for (const Table& table : kTables)
    if (std::find(found.begin(), found.end(), table.name) == found.end())
      throw InputError(database_->path() + ": found no table '" + table.name + "', expected one");
  const std::vector<std::string> others = database_->texts(
      "SELECT name FROM sqlite_master WHERE type IN ('view', 'trigger') OR sql LIKE 'CREATE VIRTUAL%'", 1);
  if (!others.empty())
    throw InputError(database_->path() + ": found '" + others.front() + "', which no session database has");
}

std::map<std::string, std::string> Reader::meta() {
  std::map<std::string, std::string> out;
  rows("meta", "SELECT * FROM meta ORDER BY key", {}, [&](SqliteStatement* row, std::string* name) -> std::string {
    std::string key(row->take_text()), value(row->take_text());
    row->take_checksum();
    *name = "meta '" + key + "'";
    if (row->row_is_sound()) out[std::move(key)] = std::move(value);
    return "";
  });
  return out;
}

void Reader::check_count(const std::string& table, std::size_t found) {
  const std::string& expected = meta_["rows " + table];
  if (std::to_string(found) != expected)
    problem(table + ": found " + std::to_string(found) + " rows, expected " +
            (expected.empty() ? "a number of them in meta" : expected));
}

bool Reader::has(const PoseKey& key) const { return keyframes_.count(key) > 0; }

std::vector<SessionState> Reader::sessions() {
  std::vector<SessionState> out;
  rows("session", "SELECT * FROM session ORDER BY id", {}, [&](SqliteStatement* row, std::string* name) -> std::string {
    SessionState state;
    const std::int64_t id = row->take_integer();
    state.start.name = row->take_text();
    state.start.source = row->take_text();
    const auto camera = row->take_bytes(), rectified = row->take_bytes();
    state.start.frames_per_second = row->take_number();
    state.ended = row->take_integer() != 0;
    const std::int64_t component = row->take_integer();
    const auto anchor = row->take_bytes(), covariance = row->take_bytes();
    row->take_text();
    row->take_checksum();
    *name = "session " + std::to_string(id);
    if (!row->row_is_sound()) return "";
    if (!fits(id, 1) || component < 1 || component > id) return "found an impossible number";
    state.id = static_cast<int>(id);
    state.component = static_cast<int>(component);
    if (!unpack(camera, &state.start.camera) || !unpack(rectified, &state.start.rectified_from_left))
      return "found a damaged camera";
    if (!unpack(anchor, &state.global_from_session) || !unpack(covariance, &state.anchor_covariance) ||
        !is_covariance(state.anchor_covariance, false))
      return "found a damaged anchor";
    cameras_[state.id] = state.start.camera;
    out.push_back(std::move(state));
    return "";
  });
  return out;
}

void Reader::read_keyframes(SessionDocument* document) {
  rows("keyframe", "SELECT * FROM keyframe ORDER BY session, keyframe", {},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         SessionPose pose;
         const RawKey key = take_key(row);
         const std::int64_t frame = row->take_integer();
         pose.time = Timestamp(row->take_integer());
         pose.after_failure = row->take_integer() != 0;
         const bool images = row->take_integer() != 0;
         row->take_checksum();
         *name = "keyframe: " + to_text(key);
         if (!row->row_is_sound()) return "";
         if (!key.fits_all() || !fits(frame, std::numeric_limits<int>::min())) return "found an impossible number";
         pose.key = key.key();
         pose.frame = static_cast<int>(frame);
         if (!cameras_.count(pose.key.session)) return "found no such session, expected one";
         keyframes_[pose.key] = images;
         document->poses.push_back(std::move(pose));
         return "";
       });
  check_count("keyframe", document->poses.size());
  std::size_t found = 0;
  auto at = document->poses.begin();
  rows("pose", "SELECT * FROM pose ORDER BY session, keyframe", {},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         const RawKey key = take_key(row);
         const auto place = row->take_bytes();
         row->take_checksum();
         *name = "pose: " + to_text(key);
         ++found;
         if (!row->row_is_sound()) return "";
         if (!key.fits_all() || !has(key.key())) return "found no such keyframe, expected one";
         while (at->key < key.key()) {
           if (++at == document->poses.end()) return "found out of order";
         }
         if (at->key != key.key()) return "found out of order";
         return unpack(place, &at->session_from_camera) ? "" : "found a damaged pose";
       });
  if (found != document->poses.size()) check_count("pose", found);
}

void Reader::read_edges(SessionDocument* document) {
  rows("edge", "SELECT * FROM edge ORDER BY session, first, second", {},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         StereoConstraint edge;
         const RawKey first = take_key(row);
         const RawKey second{first.session, row->take_integer()};
         const auto pose = row->take_bytes(), covariance = row->take_bytes();
         edge.after_failure = row->take_integer() != 0;
         row->take_checksum();
         *name = "edge: " + to_text(first) + " to " + std::to_string(second.keyframe);
         if (!row->row_is_sound()) return "";
         if (!first.fits_all() || !second.fits_all() || !has(first.key()) || !has(second.key()) ||
             first.keyframe >= second.keyframe)
           return "found no such keyframes, expected two";
         if (!unpack(pose, &edge.from_from_to)) return "found a damaged pose";
         if (!unpack(covariance, &edge.covariance) || !is_covariance(edge.covariance, true))
           return "found a damaged covariance";
         edge.from = first.key().keyframe;
         edge.to = second.key().keyframe;
         document->constraints.emplace_back(first.key().session, edge);
         return "";
       });
  check_count("edge", document->constraints.size());
}

void Reader::read_encounters(SessionDocument* document) {
  rows("encounter", "SELECT * FROM encounter ORDER BY id", {},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         Encounter e;
         e.id = row->take_integer();
         const RawKey from = take_key(row), query = take_key(row);
         const auto pose = row->take_bytes(), covariance = row->take_bytes(), scores = row->take_bytes();
         const std::int64_t matches = row->take_integer(), inliers = row->take_integer();
         const std::string state(row->take_text());
         row->take_checksum();
         *name = "encounter " + std::to_string(e.id);
         if (!row->row_is_sound()) return "";
         *name += ": " + to_text(query) + " with " + to_text(from);
         if (e.id < 1 || !fits(matches, 0) || !fits(inliers, 0)) return "found an impossible number";
         if (!from.fits_all() || !query.fits_all() || !has(from.key()) || !has(query.key()))
           return "found no such keyframes, expected two";
         e.found = from.key();
         e.query = query.key();
         e.matches = static_cast<int>(matches);
         e.inliers = static_cast<int>(inliers);
         if (!unpack(pose, &e.found_from_query)) return "found a damaged pose";
         if (!unpack(covariance, &e.covariance) || !is_covariance(e.covariance, true))
           return "found a damaged covariance";
         if (!unpack_scores(scores, &e)) return "found damaged scores";
         if (!state_of(state, &e.state)) return "found state '" + state + "', expected waiting, active, refused or off";
         document->encounters.push_back(e);
         return "";
       });
  check_count("encounter", document->encounters.size());
}

void Reader::read_maps(SessionDocument* document) {
  rows("attached_map", "SELECT * FROM attached_map ORDER BY id", {},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         AttachedMap map;
         map.id = row->take_integer();
         map.name = row->take_text();
         map.path = row->take_text();
         const std::int64_t session = row->take_integer(), keyframe = row->take_integer();
         const auto pose = row->take_bytes();
         const std::int64_t agreements = row->take_integer();
         row->take_checksum();
         *name = "attached map " + std::to_string(map.id);
         if (!row->row_is_sound()) return "";
         const RawKey key{session, keyframe};
         if (!key.fits_all() || !has(key.key())) return "found no such keyframe, expected one: " + to_text(key);
         if (map.id < 1 || !fits(agreements, 0)) return "found an impossible number";
         if (!unpack(pose, &map.keyframe_from_map)) return "found a damaged place";
         map.session = key.key().session;
         map.keyframe = key.key().keyframe;
         map.agreements = static_cast<int>(agreements);
         document->maps.push_back(std::move(map));
         return "";
       });
  check_count("attached_map", document->maps.size());
}

void Reader::check_components(const SessionDocument& document) {
  std::map<int, int> component;
  for (const SessionState& state : document.sessions) component[state.id] = state.component;
  for (const SessionState& state : document.sessions) {
    const auto named = component.find(state.component);
    if (named == component.end() || named->second != state.component)
      problem("session " + std::to_string(state.id) + ": found component " + std::to_string(state.component) +
              ", expected one that is named after a session in it");
  }
}

SessionDocument Reader::read() {
  const SameState same(database_);
  check_tables();
  meta_ = meta();
  SessionDocument document;
  document.sessions = sessions();
  check_count("session", document.sessions.size());
  read_keyframes(&document);
  read_edges(&document);
  read_encounters(&document);
  read_maps(&document);
  check_components(document);
  return document;
}

}  // namespace session_file

SessionDocument SessionDatabase::read() { return session_file::Reader(&implementation_->database, false).read(); }

std::optional<SessionState> SessionDatabase::find(const std::string& name) {
  const std::vector<SessionState> all = session_file::Reader(&implementation_->database, false).sessions();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const SessionState& state) { return state.start.name == name; });
  return found == all.end() ? std::nullopt : std::optional<SessionState>(*found);
}

SessionDocument read_session_bytes(std::span<const std::byte> file, const std::string& name) {
  SqliteDatabase database(name, file);
  session_file::check_version(&database);
  return session_file::Reader(&database, false).read();
}

}  // namespace parallax
