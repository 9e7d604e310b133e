#include "sessions/session_database.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>

#include "core/check.h"
#include "core/error.h"
#include "sessions/session_database_parts.h"

namespace parallax {
namespace {

using session_file::pack;

// So long another program may read while we wait to write, or write while we wait to read.
constexpr const char* kWait = "PRAGMA busy_timeout = 30000";

std::string now_utc() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  gmtime_r(&now, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text.data();
}

// A file that is there is looked at before it is written to.
void check_before_writing(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return;
  if (!std::filesystem::is_regular_file(path, error))
    throw InputError(path + ": found something else than a file, expected a session database");
  SqliteDatabase database(path, SqliteMode::read);
  database.run(kWait);
  // What a program leaves that was killed before its first transaction.
  if (database.number("PRAGMA user_version") == 0 && database.number("SELECT count(*) FROM sqlite_master") == 0) return;
  session_file::check_version(&database);
}

bool is_name(const std::string& name) {
  return !name.empty() && std::none_of(name.begin(), name.end(), [](unsigned char c) { return c < ' ' || c == 127; });
}

// While it is written, what is saved goes to a log beside the file first (PATH-wal): one synchronisation for a save
// instead of five, and readers and writer do not wait for each other. Full: a commit that returned stays.
void prepare_for_writing(SqliteDatabase* database, bool shared) {
  // Space that was given back can be cut off the file, without a copy of it.
  database->run("PRAGMA auto_vacuum = INCREMENTAL");
  if (!shared) database->run("PRAGMA locking_mode = EXCLUSIVE");
  database->run("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL");
}

void migrate(SqliteDatabase* database, const std::string& program) {
  SqliteTransaction transaction(database);
  const std::int64_t version = database->number("PRAGMA user_version");
  if (version != 0 || database->number("SELECT count(*) FROM sqlite_master") != 0)
    session_file::check_version(database);
  if (version == SessionDatabase::kVersion) return;
  const auto migrations = session_file::migrations();
  for (auto v = static_cast<std::size_t>(version); v < migrations.size(); ++v) database->run(migrations[v]);
  database->run("PRAGMA application_id = " + std::to_string(session_file::kApplicationId) +
                "; PRAGMA user_version = " + std::to_string(SessionDatabase::kVersion));
  SqliteStatement put(database, "INSERT OR REPLACE INTO meta VALUES(?, ?, ?)");
  const auto put_meta = [&](const std::string& key, const std::string& value) {
    put.put(std::string_view(key)).put(std::string_view(value)).put_checksum().execute();
  };
  put_meta("created", now_utc());
  put_meta("program", program);
  for (const char* what : {"session", "encounter", "attached_map"}) put_meta("next " + std::string(what), "1");
  for (const session_file::Table& table : session_file::kTables)
    if (table.counted) put_meta("rows " + std::string(table.name), "0");
  transaction.commit();
}

}  // namespace

SessionDatabase::Implementation::Implementation(const std::string& path, SqliteMode open_mode, const std::string& vfs)
    : mode(open_mode),
      // A file system of a test's own has nobody else on it.
      claim(open_mode == SqliteMode::write && vfs.empty() ? std::make_unique<SessionDatabaseClaim>(path) : nullptr),
      database(path, open_mode, vfs) {
  database.run(kWait);
}

SessionDatabase::SessionDatabase(const std::string& path, SqliteMode mode, std::string program,
                                 const std::string& vfs) {
  if (mode == SqliteMode::write && vfs.empty()) check_before_writing(path);
  implementation_ = std::make_unique<Implementation>(path, mode, vfs);
  SqliteDatabase& database = implementation_->database;
  if (mode == SqliteMode::read) {
    session_file::check_version(&database);
    return;
  }
  prepare_for_writing(&database, vfs.empty());
  migrate(&database, program);
}

SessionDatabase::~SessionDatabase() {
  if (implementation_->mode != SqliteMode::write) return;
  try {
    // At rest it is one file. Where somebody is reading still, the log stays until the last one closes.
    implementation_->database.run("PRAGMA busy_timeout = 0; PRAGMA journal_mode = DELETE");
  } catch (const std::exception&) {  // what was saved is safe in the log
  }
}

const std::string& SessionDatabase::path() const { return implementation_->database.path(); }

SessionDatabase::Implementation::Index& SessionDatabase::Implementation::known() {
  PARALLAX_CHECK(mode == SqliteMode::write, "a session database that was opened for reading is not written to");
  if (index_) return *index_;
  Index index;
  session_file::Reader reader(&database, false);
  for (const auto& [key, value] : reader.meta()) {
    if (key.rfind("rows ", 0) != 0 && key.rfind("next ", 0) != 0) continue;
    std::int64_t number = 0;
    if (std::from_chars(value.data(), value.data() + value.size(), number).ec != std::errc())
      throw InputError(database.path() + ": meta '" + key + "': found '" + value + "', expected a number");
    index.numbers[key] = number;
  }
  for (const SessionState& state : reader.sessions()) index.sessions[state.id] = state;
  {
    SqliteStatement statement(&database, "SELECT id, began FROM session");
    while (statement.next()) {
      const int id = static_cast<int>(statement.take_integer());
      index.began[id] = statement.take_text();
    }
  }
  {
    SqliteStatement statement(&database, "SELECT session, keyframe FROM keyframe");
    while (statement.next()) {
      PoseKey key;
      key.session = static_cast<int>(statement.take_integer());
      key.keyframe = static_cast<int>(statement.take_integer());
      index.keyframes.insert(index.keyframes.end(), key);
    }
  }
  SqliteStatement statement(&database, "SELECT id FROM encounter ORDER BY id");
  while (statement.next()) index.encounters.insert(index.encounters.end(), statement.take_integer());
  index_ = std::move(index);
  return *index_;
}

void SessionDatabase::Implementation::put_numbers(const std::map<std::string, std::int64_t>& before,
                                                  const Index& index) {
  SqliteStatement put(&database, "INSERT OR REPLACE INTO meta VALUES(?, ?, ?)");
  for (const auto& [key, number] : index.numbers) {
    const auto was = before.find(key);
    if (was != before.end() && was->second == number) continue;
    const std::string text = std::to_string(number);
    put.put(std::string_view(key)).put(std::string_view(text)).put_checksum().execute();
  }
}

void SessionDatabase::Implementation::in_transaction(const std::function<void(Index*)>& work) {
  Index& index = known();
  const std::map<std::string, std::int64_t> before = index.numbers;
  try {
    SqliteTransaction transaction(&database);
    work(&index);
    put_numbers(before, index);
    transaction.commit();
  } catch (...) {
    index_.reset();
    throw;
  }
}

void SessionDatabase::Implementation::put_session(const SessionState& state, const std::string& began_utc) {
  const std::vector<std::byte> camera = pack(state.start.camera), rectified = pack(state.start.rectified_from_left),
                               anchor = pack(state.global_from_session), covariance = pack(state.anchor_covariance);
  SqliteStatement put(&database, "INSERT OR REPLACE INTO session VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  put.put(state.id).put(std::string_view(state.start.name)).put(std::string_view(state.start.source)).put(camera);
  put.put(rectified).put(state.start.frames_per_second).put(state.ended).put(state.component).put(anchor);
  put.put(covariance).put(std::string_view(began_utc)).put_checksum().execute();
}

void SessionDatabase::Implementation::put_encounter(const Encounter& e) {
  const std::vector<std::byte> pose = pack(e.found_from_query), covariance = pack(e.covariance),
                               scores = session_file::pack_scores(e);
  SqliteStatement put(&database, "INSERT OR REPLACE INTO encounter VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  put.put(e.id).put(e.found.session).put(e.found.keyframe).put(e.query.session).put(e.query.keyframe).put(pose);
  put.put(covariance).put(scores).put(e.matches).put(e.inliers);
  put.put(std::string_view(session_file::name_of(e.state))).put_checksum().execute();
}

void SessionDatabase::Implementation::put_map(const AttachedMap& map) {
  const std::vector<std::byte> pose = pack(map.keyframe_from_map);
  SqliteStatement put(&database, "INSERT OR REPLACE INTO attached_map VALUES(?, ?, ?, ?, ?, ?, ?, ?)");
  put.put(map.id).put(std::string_view(map.name)).put(std::string_view(map.path)).put(map.session).put(map.keyframe);
  put.put(pose).put(map.agreements).put_checksum().execute();
}

void SessionDatabase::Implementation::recount(Index* index) {
  for (const session_file::Table& table : session_file::kTables)
    if (table.counted)
      index->numbers["rows " + std::string(table.name)] =
          database.number("SELECT count(*) FROM " + std::string(table.name));
}

std::string SessionDatabase::Implementation::unique_name(const Index& index, const std::string& name) const {
  const auto is_taken = [&](const std::string& wanted) {
    return std::any_of(index.sessions.begin(), index.sessions.end(),
                       [&](const auto& entry) { return entry.second.start.name == wanted; });
  };
  const std::string wanted = name.empty() ? "session" : name;
  std::string out = wanted;
  for (int number = 2; is_taken(out); ++number) out = wanted + "-" + std::to_string(number);
  return out;
}

SessionState SessionDatabase::begin_session(const SessionStart& start) {
  Implementation& self = *implementation_;
  PARALLAX_CHECK(session_file::is_sound(start.camera) && session_file::is_sound(start.rectified_from_left) &&
                     std::isfinite(start.frames_per_second) && start.frames_per_second >= 0,
                 "a session begins with a camera");
  SessionState state;
  self.in_transaction([&](Implementation::Index* index) {
    state.id = static_cast<int>(index->numbers["next session"]++);
    state.component = state.id;
    state.start = start;
    state.start.name = self.unique_name(*index, start.name);
    index->began[state.id] = now_utc();
    self.put_session(state, index->began[state.id]);
    index->sessions[state.id] = state;
    ++index->numbers["rows session"];
  });
  return state;
}

void SessionDatabase::add_map(AttachedMap* map) {
  implementation_->in_transaction([&](Implementation::Index* index) {
    PARALLAX_CHECK(index->keyframes.count({map->session, map->keyframe}) > 0 &&
                       session_file::is_sound(map->keyframe_from_map) && map->agreements >= 0,
                   "the map '" + map->name + "' hangs on a keyframe of the database");
    map->id = index->numbers["next attached_map"]++;
    implementation_->put_map(*map);
    ++index->numbers["rows attached_map"];
  });
}

void SessionDatabase::remove_map(std::int64_t id) {
  implementation_->in_transaction([&](Implementation::Index* index) {
    implementation_->database.run("DELETE FROM attached_map WHERE id = " + std::to_string(id));
    implementation_->recount(index);
  });
}

void SessionDatabase::rename_session(int session, const std::string& name) {
  implementation_->in_transaction([&](Implementation::Index* index) {
    PARALLAX_CHECK(index->sessions.count(session) > 0, "a session of the database is renamed");
    if (!is_name(name)) throw InputError(path() + ": found '" + name + "', expected a name without control characters");
    for (const auto& [id, state] : index->sessions)
      if (id != session && state.start.name == name)
        throw InputError(path() + ": found a session '" + name + "' already, expected a name that none has");
    SessionState& state = index->sessions[session];
    state.start.name = name;
    implementation_->put_session(state, index->began[session]);
  });
}

void SessionDatabase::compact() {
  PARALLAX_CHECK(implementation_->mode == SqliteMode::write, "a session database that was opened for reading");
  implementation_->database.run("PRAGMA incremental_vacuum; PRAGMA wal_checkpoint(TRUNCATE)");
}

std::int64_t SessionDatabase::next_encounter() { return implementation_->known().numbers["next encounter"]; }

std::string SessionDatabase::began(int session) {
  const std::vector<std::string> found =
      implementation_->database.texts("SELECT began FROM session WHERE id = " + std::to_string(session), 1);
  return found.empty() ? std::string() : found.front();
}

}  // namespace parallax
