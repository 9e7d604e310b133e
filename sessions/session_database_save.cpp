// Saving a batch: what could not be read again is not written.
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "sessions/session_database_parts.h"

namespace parallax {
namespace {

using session_file::is_covariance;
using session_file::pack;

// What a batch says, against what the file holds. The index follows.
class BatchWriter {
 public:
  using Index = SessionDatabase::Implementation::Index;
  BatchWriter(SessionDatabase::Implementation* self, Index* index, const SessionBatch& batch)
      : self_(*self), database_(&self->database), index_(*index), batch_(batch) {}
  void write();

 private:
  void expect(const PoseKey& key, const char* of) const {
    PARALLAX_CHECK(index_.keyframes.count(key) > 0,
                   std::string(of) + ": " + session_file::to_text(key) + " is not in the database");
  }
  std::int64_t& rows(const char* table) { return index_.numbers["rows " + std::string(table)]; }
  bool is_there(const char* table, int first, int last, const char* last_column) {
    return database_->number(
               "SELECT count(*) FROM " + std::string(table) + " WHERE session = " + std::to_string(batch_.session) +
               " AND first = " + std::to_string(first) + " AND " + last_column + " = " + std::to_string(last)) != 0;
  }
  void write_keyframes();
  void write_edge(const StereoConstraint& edge, SqliteStatement* insert);
  void write_windows();
  void write_encounters();
  void write_moved();
  void write_states();
  void write_timings();

  SessionDatabase::Implementation& self_;
  SqliteDatabase* database_;
  Index& index_;
  const SessionBatch& batch_;
};

void BatchWriter::write() {
  if (!batch_.keyframes.empty() || !batch_.windows.empty())
    PARALLAX_CHECK(index_.sessions.count(batch_.session) > 0, "keyframes and windows of a session that has begun");
  write_keyframes();
  write_windows();
  write_encounters();
  write_moved();
  write_states();
  write_timings();
}

void BatchWriter::write_keyframes() {
  if (batch_.keyframes.empty()) return;
  const StereoCamera& camera = index_.sessions.at(batch_.session).start.camera;
  SqliteStatement keyframe(database_, "INSERT INTO keyframe VALUES(?, ?, ?, ?, ?, ?, ?)");
  SqliteStatement pose(database_, "INSERT INTO pose VALUES(?, ?, ?, ?)");
  SqliteStatement feature(database_, "INSERT INTO feature VALUES(?, ?, ?, ?)");
  SqliteStatement image(database_, "INSERT INTO image VALUES(?, ?, ?, ?, ?, ?, ?)");
  std::string left, right;
  for (const SessionBatch::NewKeyframe& added : batch_.keyframes) {
    const SessionKeyframe& kf = added.keyframe;
    const PoseKey key{batch_.session, kf.index};
    const bool images = !kf.left.empty();
    const cv::Size size = images ? cv::Size(camera.width, camera.height) : cv::Size();
    PARALLAX_CHECK(kf.index >= 0 && session_file::is_sound(kf.session_from_camera) &&
                       session_file::is_sound(added.features) && kf.left.size() == size && kf.right.size() == size,
                   session_file::to_text(key) + " is not sound");
    if (!index_.keyframes.insert(key).second) continue;
    keyframe.put(key.session).put(key.keyframe).put(kf.frame).put(kf.time.count()).put(kf.after_failure).put(images);
    keyframe.put_checksum().execute();
    const std::vector<std::byte> place = pack(kf.session_from_camera), features = pack(added.features);
    pose.put(key.session).put(key.keyframe).put(place).put_checksum().execute();
    feature.put(key.session).put(key.keyframe).put(features).put_checksum().execute();
    for (const char* table : {"keyframe", "pose", "feature"}) ++rows(table);
    if (!images) continue;
    left.clear();
    right.clear();
    self_.codec.pack_grey(kf.left, &left);
    self_.codec.pack_grey(kf.right, &right);
    image.put(key.session).put(key.keyframe).put(size.width).put(size.height);
    image.put(std::as_bytes(std::span(left))).put(std::as_bytes(std::span(right))).put_checksum().execute();
    ++rows("image");
  }
}

void BatchWriter::write_edge(const StereoConstraint& edge, SqliteStatement* insert) {
  expect({batch_.session, edge.from}, "constraint");
  expect({batch_.session, edge.to}, "constraint");
  PARALLAX_CHECK(
      edge.from < edge.to && session_file::is_sound(edge.from_from_to) && is_covariance(edge.covariance, true),
      "the constraint to " + session_file::to_text(PoseKey{batch_.session, edge.to}) + " is not sound");
  if (is_there("edge", edge.from, edge.to, "second")) return;
  const std::vector<std::byte> pose = pack(edge.from_from_to), covariance = pack(edge.covariance);
  insert->put(batch_.session).put(edge.from).put(edge.to).put(pose).put(covariance).put(edge.after_failure);
  insert->put_checksum().execute();
  ++rows("edge");
}

void BatchWriter::write_windows() {
  if (batch_.windows.empty()) return;
  SqliteStatement edge(database_, "INSERT INTO edge VALUES(?, ?, ?, ?, ?, ?, ?)");
  SqliteStatement point(database_, "INSERT INTO point VALUES(?, ?, ?, ?, ?)");
  for (const SessionWindow& window : batch_.windows) {
    for (const StereoConstraint& constraint : window.constraints) write_edge(constraint, &edge);
    if (window.points.empty()) continue;
    // A window is told by its keyframes: those it constrains, else those that its points follow.
    int first = window.points.front().keyframe, last = first, former = -1;
    for (const SessionPoint& p : window.points) {
      if (p.keyframe != former) expect({batch_.session, p.keyframe}, "point");
      former = p.keyframe;
      first = std::min(first, p.keyframe);
      last = std::max(last, p.keyframe);
    }
    if (!window.constraints.empty()) {
      first = window.constraints.front().from;
      last = window.constraints.back().to;
    }
    PARALLAX_CHECK(session_file::is_sound(window.points),
                   "points of session " + std::to_string(batch_.session) + " are not sound");
    if (is_there("point", first, last, "last")) continue;
    const std::vector<std::byte> points = pack(window.points);
    point.put(batch_.session).put(first).put(last).put(points).put_checksum().execute();
    ++rows("point");
  }
}

void BatchWriter::write_encounters() {
  std::int64_t& next = index_.numbers["next encounter"];
  for (const Encounter& e : batch_.encounters) {
    expect(e.found, "encounter");
    expect(e.query, "encounter");
    PARALLAX_CHECK(e.id > 0 && e.found != e.query && e.matches >= 0 && e.inliers >= 0 &&
                       session_file::is_sound(e.found_from_query) && is_covariance(e.covariance, true) &&
                       session_file::are_scores(e),
                   "encounter " + std::to_string(e.id) + " is not sound");
    self_.put_encounter(e);
    if (index_.encounters.insert(e.id).second) ++rows("encounter");
    next = std::max(next, e.id + 1);
  }
}

void BatchWriter::write_moved() {
  if (batch_.moved.empty()) return;
  SqliteStatement replace(database_, "INSERT OR REPLACE INTO pose VALUES(?, ?, ?, ?)");
  for (const SessionPose& pose : batch_.moved) {
    expect(pose.key, "pose");
    PARALLAX_CHECK(session_file::is_sound(pose.session_from_camera),
                   "the pose of " + session_file::to_text(pose.key) + " is not sound");
    const std::vector<std::byte> place = pack(pose.session_from_camera);
    replace.put(pose.key.session).put(pose.key.keyframe).put(place).put_checksum().execute();
  }
}

void BatchWriter::write_states() {
  for (const SessionState& state : batch_.states) {
    const auto there = index_.sessions.find(state.id);
    PARALLAX_CHECK(there != index_.sessions.end() && index_.sessions.count(state.component) > 0 &&
                       state.component <= state.id && session_file::is_sound(state.global_from_session) &&
                       is_covariance(state.anchor_covariance, false),
                   "the state of session " + std::to_string(state.id) + " is not sound");
    const SessionStart start = there->second.start;
    there->second = state;
    there->second.start = start;
    self_.put_session(there->second, index_.began[state.id]);
  }
  // A component is named after its earliest session, which is in it.
  for (const auto& [id, state] : index_.sessions)
    PARALLAX_CHECK(index_.sessions.at(state.component).component == state.component,
                   "the component of session " + std::to_string(id) + " is named after one of another");
}

void BatchWriter::write_timings() {
  if (batch_.timings.empty()) return;
  SqliteStatement put(database_, "INSERT OR REPLACE INTO timing VALUES(?, ?, ?, ?, ?, ?)");
  for (const SessionTiming& t : batch_.timings) {
    PARALLAX_CHECK(index_.sessions.count(t.key.session) > 0 && t.key.keyframe >= 0 && std::isfinite(t.ms) && t.ms >= 0,
                   "a timing of " + session_file::to_text(t.key) + " is not sound");
    put.put(t.key.session).put(t.key.keyframe).put(t.module).put(t.loop).put(t.ms).put_checksum().execute();
  }
}

}  // namespace

void SessionDatabase::save(std::span<const SessionBatch> batches) {
  implementation_->in_transaction([&](Implementation::Index* index) {
    for (const SessionBatch& batch : batches) BatchWriter(implementation_.get(), index, batch).write();
  });
}

}  // namespace parallax
