// What the sources of the session database share: reading rows of which nothing is believed, and what a writer knows of
// its file. Internal to session_database*.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/image_codec.h"
#include "sessions/session_database.h"
#include "sessions/session_database_claim.h"
#include "sessions/session_schema.h"

namespace parallax {
namespace session_file {

inline bool fits(std::int64_t value, std::int64_t least) {
  return value >= least && value <= std::numeric_limits<int>::max();
}

// Numbers of a row as they come, before they are believed.
struct RawKey {
  std::int64_t session = 0, keyframe = 0;
  bool fits_all() const { return fits(session, 1) && fits(keyframe, 0); }
  PoseKey key() const { return {static_cast<int>(session), static_cast<int>(keyframe)}; }
};

inline RawKey take_key(SqliteStatement* row) {
  RawKey out;
  out.session = row->take_integer();
  out.keyframe = row->take_integer();
  return out;
}

std::string to_text(const RawKey& key);  // "session 2, keyframe 3"
std::string to_text(const PoseKey& key);

inline constexpr std::size_t kMostProblems = 50;  // that are told of one file

// Several queries that see the same state of the file.
class SameState {
 public:
  explicit SameState(SqliteDatabase* database);
  ~SameState();
  SameState(const SameState&) = delete;
  SameState& operator=(const SameState&) = delete;

 private:
  SqliteDatabase* database_;
};

// Throws InputError when it is something else than a session database, or of another version than up to ours.
void check_version(SqliteDatabase* database);

class Reader {
 public:
  // Throws at the first problem unless `all` are wanted.
  Reader(SqliteDatabase* database, bool all) : database_(database), all_(all) {}

  SessionDocument read();
  std::map<std::string, std::string> meta();
  std::vector<SessionState> sessions();
  std::vector<SessionPoint> points(int session);
  std::vector<SessionTiming> timings();
  SessionFeatures features(const PoseKey& key);
  bool images(const PoseKey& key, GreyImage* left, GreyImage* right, ImageCodec* codec);

  // With features, images, points and timings, and the pages of the file.
  void verify();
  const std::vector<std::string>& problems() const { return problems_; }

 private:
  using Take = std::function<std::string(SqliteStatement*, std::string* name)>;
  void problem(const std::string& text);
  // Every row of a query on a table: `take` reads the columns, says how the row is named and what is wrong with it,
  // empty for nothing. `values`: bound to the query.
  void rows(const std::string& table, const std::string& query, const std::vector<std::int64_t>& values,
            const Take& take);
  void check_tables();
  void read_keyframes(SessionDocument* document);
  void read_edges(SessionDocument* document);
  void read_encounters(SessionDocument* document);
  void read_maps(SessionDocument* document);
  void check_components(const SessionDocument& document);
  void check_count(const std::string& table, std::size_t found);
  bool has(const PoseKey& key) const;

  SqliteDatabase* database_;
  bool all_;
  std::vector<std::string> problems_;
  std::map<std::string, std::string> meta_;
  std::map<int, StereoCamera> cameras_;
  std::map<PoseKey, bool> keyframes_;  // whether images were kept
};

}  // namespace session_file

struct SessionDatabase::Implementation {
  // What a writer knows of its file, so that not every row asks for it.
  struct Index {
    std::map<int, SessionState> sessions;
    std::map<int, std::string> began;
    std::set<PoseKey> keyframes;
    std::set<std::int64_t> encounters;
    std::map<std::string, std::int64_t> numbers;  // of `meta`: how many rows a table has, and the next identifiers
  };

  Implementation(const std::string& path, SqliteMode open_mode, const std::string& vfs);

  // Loads it when it is not there: after opening, and after a transaction that failed.
  Index& known();
  // Does the work in one transaction; what fails leaves file and index as they were.
  void in_transaction(const std::function<void(Index*)>& work);
  void put_session(const SessionState& state, const std::string& began_utc);
  void put_encounter(const Encounter& encounter);
  void put_map(const AttachedMap& map);
  // Counts rows anew, after more than a few have come or gone.
  void recount(Index* index);
  std::string unique_name(const Index& index, const std::string& name) const;

  SqliteMode mode;
  std::unique_ptr<SessionDatabaseClaim> claim;
  SqliteDatabase database;
  ImageCodec codec;

 private:
  void put_numbers(const std::map<std::string, std::int64_t>& before, const Index& index);
  std::optional<Index> index_;
};

}  // namespace parallax
