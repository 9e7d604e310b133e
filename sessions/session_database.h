// Sessions in a file: SQLite, one file, versioned, as the map files (map/map_file.h). docs/sessions.md describes the
// tables. While it is written there are files beside it (-wal, -shm, .writer); one that a killed program leaves belongs
// to it until it is next opened.
//
// What belongs together is written in one transaction: whoever is killed, loses power or runs out of disk leaves what
// was written before. Images and features are written once. Every row carries a checksum. One process may write at a
// time; others may read meanwhile, and see what was saved last. Not thread-safe.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "map/sqlite.h"
#include "sessions/session_types.h"

namespace parallax {

// All of a database but images and features.
struct SessionDocument {
  std::vector<SessionState> sessions;                         // by id
  std::vector<SessionPose> poses;                             // by key
  std::vector<std::pair<int, StereoConstraint>> constraints;  // with their session; by session and keyframe
  std::vector<Encounter> encounters;                          // by id
  std::vector<AttachedMap> maps;
};

// What is written at once. Everything is durable when save() returns. Values must be sound: finite, rotations to 1e-6,
// covariances symmetric and positive definite (of anchors: semi-definite), and what they refer to in the database or in
// the batch itself.
struct SessionBatch {
  int session = 0;  // of windows, features and images
  struct NewKeyframe {
    SessionKeyframe keyframe;
    SessionFeatures features;
  };
  std::vector<NewKeyframe> keyframes;
  std::vector<SessionWindow> windows;
  std::vector<Encounter> encounters;   // new, or changed: those with the id of one that is there replace it
  std::vector<SessionPose> moved;      // estimates that have changed, of any session; nothing else of them is taken
  std::vector<SessionState> states;    // sessions that have changed: all but `start`, which stays as it began
  std::vector<SessionTiming> timings;  // the last of a key, module and loop stays
};

class SessionDatabase {
 public:
  static constexpr int kVersion = 1;

  // write: made when it is not there; InputError when it is something else than a session database or of a later
  // version, or when another process has it open for writing; RunError when it cannot be written. `vfs` as in
  // SqliteDatabase.
  SessionDatabase(const std::string& path, SqliteMode mode, std::string program = {}, const std::string& vfs = {});
  ~SessionDatabase();
  SessionDatabase(const SessionDatabase&) = delete;
  SessionDatabase& operator=(const SessionDatabase&) = delete;

  const std::string& path() const;

  // A new session; its name is made unique. Durable when it returns.
  SessionState begin_session(const SessionStart& start);
  // Throws RunError ("PATH: cannot be written: ..."): all is as before then; only when the program ends before it saves
  // again may such a batch be found in the file, whole. The same keyframe or window again
  // (told by its keyframe indices) is passed over: messages may arrive twice. CHECK on a batch that is not sound:
  // nothing is written then.
  void save(const SessionBatch& batch) { save(std::span(&batch, 1)); }
  // Several in one transaction, in order.
  void save(std::span<const SessionBatch> batches);
  void add_map(AttachedMap* map);  // gives it its id
  void remove_map(std::int64_t id);
  // InputError ("PATH: ...") when another session has the name, or it is none: empty, or with control characters.
  void rename_session(int session, const std::string& name);
  // With all that hangs on it: encounters, attached maps. Sessions that had met only by way of it part; estimates
  // stay as they are. The file shrinks with compact().
  void erase_session(int session);
  void compact();
  // Keyframes from this index on, and all that hangs on them, are taken out: what a front end that was killed had sent
  // but never handed over.
  void truncate_session(int session, int keyframes);

  // InputError ("PATH: session 2, keyframe 3: found damaged bytes, expected ...").
  SessionDocument read();
  std::optional<SessionState> find(const std::string& name);
  std::string began(int session);  // UTC, when the session was begun; empty: unknown session
  std::vector<SessionPoint> points(int session);
  std::vector<SessionTiming> timings();
  SessionFeatures features(const PoseKey& key);
  // Rectified; false when images were not kept.
  bool images(const PoseKey& key, GreyImage* left, GreyImage* right);
  std::int64_t next_encounter();  // an id that is free, and those above it; never one that was used before

  // Everything of another database becomes part of this one under new session numbers, in one transaction. Returns
  // the new numbers by the old. Before anything is written, InputError as expect_new_sessions().
  std::vector<std::pair<int, int>> take(SessionDatabase* other);
  // InputError ("OTHER: session 'tuesday' is in PATH already, ...") when the other one holds a session that is in this
  // one too, under whatever name and number: begun at the same time, of the same source, and with the same features in
  // its first keyframe.
  void expect_new_sessions(SessionDatabase* other);

  struct Implementation;

 private:
  std::unique_ptr<Implementation> implementation_;
};

// The document in the bytes of a file. `name` stands for the path.
SessionDocument read_session_bytes(std::span<const std::byte> file, const std::string& name);

// All that is wrong with a file, a line each, at most 50; empty: nothing. Never throws for what is in the file.
std::vector<std::string> verify_session_database(const std::string& path);

}  // namespace parallax
