// Reading what is large in a session database, and verifying all of it.
#include <cmath>

#include "core/error.h"
#include "sessions/session_database_parts.h"

namespace parallax {
namespace session_file {

std::vector<SessionPoint> Reader::points(int session) {
  std::vector<SessionPoint> out;
  rows("point", "SELECT * FROM point WHERE session = ? ORDER BY first, last", {session},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         const RawKey first = take_key(row);
         const std::int64_t last = row->take_integer();
         const auto bytes = row->take_bytes();
         row->take_checksum();
         *name = "point: " + to_text(first) + " to " + std::to_string(last);
         if (!row->row_is_sound()) return "";
         std::vector<SessionPoint> points;
         if (!unpack(bytes, &points)) return "found damaged points";
         out.insert(out.end(), points.begin(), points.end());
         return "";
       });
  return out;
}

std::vector<SessionTiming> Reader::timings() {
  std::vector<SessionTiming> out;
  rows("timing", "SELECT * FROM timing ORDER BY session, keyframe, module, closed", {},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         SessionTiming timing;
         const RawKey key = take_key(row);
         const std::int64_t module = row->take_integer();
         timing.loop = row->take_integer() != 0;
         timing.ms = row->take_number();
         row->take_checksum();
         *name = "timing: " + to_text(key);
         if (!row->row_is_sound()) return "";
         if (!key.fits_all() || module < 0 || module > static_cast<int>(SessionModule::pose_graph) ||
             !std::isfinite(timing.ms) || timing.ms < 0)
           return "found an impossible number";
         timing.key = key.key();
         timing.module = static_cast<SessionModule>(module);
         out.push_back(timing);
         return "";
       });
  return out;
}

SessionFeatures Reader::features(const PoseKey& key) {
  SessionFeatures out;
  bool found = false;
  rows("feature", "SELECT * FROM feature WHERE session = ? AND keyframe = ?", {key.session, key.keyframe},
       [&](SqliteStatement* row, std::string* name) -> std::string {
         const RawKey there = take_key(row);
         const auto bytes = row->take_bytes();
         row->take_checksum();
         *name = "feature: " + to_text(key);
         found = true;
         if (!row->row_is_sound()) return "";
         if (!there.fits_all() || there.key() != key) return "found those of " + to_text(there);
         return unpack(bytes, &out) ? "" : "found damaged features";
       });
  if (!found) problem("feature: " + to_text(key) + ": found none, expected those of the keyframe");
  return out;
}

bool Reader::images(const PoseKey& key, GreyImage* left, GreyImage* right, ImageCodec* codec) {
  const std::vector<std::int64_t> values{key.session, key.keyframe};
  bool kept = false, known = false;
  rows("keyframe", "SELECT * FROM keyframe WHERE session = ? AND keyframe = ?", values,
       [&](SqliteStatement* row, std::string* name) -> std::string {
         take_key(row);
         for (int i = 0; i < 3; ++i) row->take_integer();
         kept = row->take_integer() != 0;
         row->take_checksum();
         *name = "keyframe: " + to_text(key);
         known = true;
         return "";
       });
  if (!known) problem("keyframe: " + to_text(key) + ": found none, expected one");
  if (!kept) return false;
  bool found = false;
  rows("image", "SELECT * FROM image WHERE session = ? AND keyframe = ?", values,
       [&](SqliteStatement* row, std::string* name) -> std::string {
         const RawKey there = take_key(row);
         const std::int64_t width = row->take_integer(), height = row->take_integer();
         const auto left_bytes = row->take_bytes(), right_bytes = row->take_bytes();
         row->take_checksum();
         *name = "image: " + to_text(key);
         found = true;
         if (!row->row_is_sound()) return "";
         if (!there.fits_all() || there.key() != key) return "found those of " + to_text(there);
         if (width < 8 || height < 8 || width > 1 << 14 || height > 1 << 14) return "found an impossible size";
         const cv::Size size(static_cast<int>(width), static_cast<int>(height));
         const auto unpack_grey = [&](std::span<const std::byte> bytes, GreyImage* image) {
           return codec->unpack_grey({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, size, image);
         };
         return unpack_grey(left_bytes, left) && unpack_grey(right_bytes, right) ? "" : "found damaged pixels";
       });
  if (!found) problem("image: " + to_text(key) + ": found none, expected those of the keyframe");
  return found;
}

void Reader::verify() {
  for (const std::string& line : database_->texts("PRAGMA integrity_check", kMostProblems))
    if (line != "ok") problem("database: " + line);
  const SessionDocument document = read();
  const SameState same(database_);
  ImageCodec codec;
  for (const auto& [key, images_kept] : keyframes_) {
    features(key);
    GreyImage left, right;
    const std::size_t before = problems_.size();
    if (images(key, &left, &right, &codec) && problems_.size() == before) {
      const StereoCamera& camera = cameras_.at(key.session);
      if (left.size() != cv::Size(camera.width, camera.height))
        problem("image: " + to_text(key) + ": found another size than the camera's");
    }
  }
  for (const SessionState& state : document.sessions) {
    int former = -1;
    for (const SessionPoint& p : points(state.id)) {
      if (p.keyframe != former && !has({state.id, p.keyframe}))
        problem("point: " + to_text(PoseKey{state.id, p.keyframe}) + ": found no such keyframe, expected one");
      former = p.keyframe;
    }
  }
  timings();
  for (const char* table : {"feature", "image", "point"})
    check_count(table, static_cast<std::size_t>(database_->number("SELECT count(*) FROM " + std::string(table))));
}

}  // namespace session_file

std::vector<SessionPoint> SessionDatabase::points(int session) {
  return session_file::Reader(&implementation_->database, false).points(session);
}

std::vector<SessionTiming> SessionDatabase::timings() {
  return session_file::Reader(&implementation_->database, false).timings();
}

SessionFeatures SessionDatabase::features(const PoseKey& key) {
  return session_file::Reader(&implementation_->database, false).features(key);
}

bool SessionDatabase::images(const PoseKey& key, GreyImage* left, GreyImage* right) {
  return session_file::Reader(&implementation_->database, false).images(key, left, right, &implementation_->codec);
}

std::vector<std::string> verify_session_database(const std::string& path) {
  std::vector<std::string> out;
  const auto note = [&](const InputError& e) {
    const std::string text = e.what();
    out.push_back(text.rfind(path + ": ", 0) == 0 ? text.substr(path.size() + 2) : text);
  };
  std::optional<SqliteDatabase> database;
  try {
    database.emplace(path, SqliteMode::read);
    database->run("PRAGMA busy_timeout = 30000");
    session_file::check_version(&*database);
  } catch (const InputError& e) {
    note(e);
    return out;
  }
  session_file::Reader reader(&*database, true);
  try {
    reader.verify();
  } catch (const InputError& e) {
    note(e);
  }
  out.insert(out.begin(), reader.problems().begin(), reader.problems().end());
  return out;
}

}  // namespace parallax
