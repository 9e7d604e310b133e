#include "sessions/session_database.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <bit>
#include <filesystem>
#include <opencv2/core.hpp>

#include "core/check.h"
#include "core/error.h"
#include "tests/sessions/fabricated_sessions.h"
#include "tests/support/memory_folder.h"

namespace parallax {
namespace {

using test::fabricated_start;
using test::SessionFabricator;
using testing::MemoryFolder;

void database_sql(const std::string& path, const std::string& sql) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  char* why = nullptr;
  EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, &why), SQLITE_OK) << (why ? why : "");
  sqlite3_free(why);
  sqlite3_close(handle);
}

bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

void expect_same(const SessionState& a, const SessionState& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.start.name, b.start.name);
  EXPECT_EQ(a.start.source, b.start.source);
  EXPECT_EQ(a.start.camera, b.start.camera);
  EXPECT_EQ(a.start.rectified_from_left.R, b.start.rectified_from_left.R);
  EXPECT_EQ(a.start.frames_per_second, b.start.frames_per_second);
  EXPECT_EQ(a.ended, b.ended);
  EXPECT_EQ(a.component, b.component);
  EXPECT_EQ(a.global_from_session.R, b.global_from_session.R);
  EXPECT_EQ(a.global_from_session.t, b.global_from_session.t);
  EXPECT_EQ(a.anchor_covariance, b.anchor_covariance);
}

void expect_same(const Encounter& a, const Encounter& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.found, b.found);
  EXPECT_EQ(a.query, b.query);
  EXPECT_EQ(a.found_from_query.R, b.found_from_query.R);
  EXPECT_EQ(a.found_from_query.t, b.found_from_query.t);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_TRUE(same_bits(a.bow, b.bow) && same_bits(a.crf_near, b.crf_near) && same_bits(a.crf_far, b.crf_far));
  EXPECT_EQ(a.matches, b.matches);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.state, b.state);
}

void expect_same(const SessionDocument& a, const SessionDocument& b) {
  ASSERT_EQ(a.sessions.size(), b.sessions.size());
  for (std::size_t i = 0; i < a.sessions.size(); ++i) expect_same(a.sessions[i], b.sessions[i]);
  ASSERT_EQ(a.poses.size(), b.poses.size());
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_EQ(a.poses[i].key, b.poses[i].key);
    EXPECT_EQ(a.poses[i].frame, b.poses[i].frame);
    EXPECT_EQ(a.poses[i].time, b.poses[i].time);
    EXPECT_EQ(a.poses[i].after_failure, b.poses[i].after_failure);
    EXPECT_EQ(a.poses[i].session_from_camera.R, b.poses[i].session_from_camera.R);
    EXPECT_EQ(a.poses[i].session_from_camera.t, b.poses[i].session_from_camera.t);
  }
  ASSERT_EQ(a.constraints.size(), b.constraints.size());
  for (std::size_t i = 0; i < a.constraints.size(); ++i) {
    const auto& [session, c] = a.constraints[i];
    const auto& [other, d] = b.constraints[i];
    EXPECT_EQ(session, other);
    EXPECT_EQ(std::tie(c.from, c.to, c.after_failure), std::tie(d.from, d.to, d.after_failure));
    EXPECT_EQ(c.from_from_to.R, d.from_from_to.R);
    EXPECT_EQ(c.from_from_to.t, d.from_from_to.t);
    EXPECT_EQ(c.covariance, d.covariance);
  }
  ASSERT_EQ(a.encounters.size(), b.encounters.size());
  for (std::size_t i = 0; i < a.encounters.size(); ++i) expect_same(a.encounters[i], b.encounters[i]);
  ASSERT_EQ(a.maps.size(), b.maps.size());
  for (std::size_t i = 0; i < a.maps.size(); ++i) {
    EXPECT_EQ(std::tie(a.maps[i].id, a.maps[i].name, a.maps[i].path, a.maps[i].session, a.maps[i].agreements),
              std::tie(b.maps[i].id, b.maps[i].name, b.maps[i].path, b.maps[i].session, b.maps[i].agreements));
    EXPECT_EQ(a.maps[i].keyframe, b.maps[i].keyframe);
    EXPECT_EQ(a.maps[i].keyframe_from_map.s, b.maps[i].keyframe_from_map.s);
    EXPECT_EQ(a.maps[i].keyframe_from_map.R, b.maps[i].keyframe_from_map.R);
  }
}

void expect_same(const SessionFeatures& a, const SessionFeatures& b) {
  ASSERT_EQ(a.features.size(), b.features.size());
  ASSERT_EQ(a.right_px.size(), b.right_px.size());
  for (std::size_t i = 0; i < a.features.size(); ++i) {
    EXPECT_EQ(a.features[i].pixel, b.features[i].pixel);
    EXPECT_EQ(a.features[i].level, b.features[i].level);
    EXPECT_EQ(a.features[i].descriptor.bits, b.features[i].descriptor.bits);
    EXPECT_EQ(std::bit_cast<std::uint32_t>(a.right_px[i]), std::bit_cast<std::uint32_t>(b.right_px[i]));
  }
}

// Two sessions of five and three keyframes, met twice, and a map that hangs on the first. Returns all that was saved.
struct SavedSessions {
  SessionDocument document;
  std::vector<SessionBatch> batches;
};
SavedSessions save_two_sessions(SessionDatabase* database, std::uint64_t seed = 1) {
  SessionFabricator make(seed);
  SavedSessions out;
  for (const int keyframes : {5, 3}) {
    SessionState state = database->begin_session(fabricated_start(keyframes == 5 ? "monday" : "tuesday"));
    out.batches.push_back(make.batch(state.id, keyframes));
    SessionBatch& batch = out.batches.back();
    if (state.id == 2) {
      batch.encounters = {make.encounter(database->next_encounter(), {1, 2}, {2, 1}, EncounterState::active),
                          make.encounter(database->next_encounter() + 1, {1, 0}, {2, 2}, EncounterState::waiting)};
      state.component = 1;
      state.global_from_session = make.transform();
      state.anchor_covariance = make.covariance();
      batch.timings = {{{2, 1}, SessionModule::pose_graph, 1.25, true}, {{2, 2}, SessionModule::window, 7, false}};
    }
    state.ended = true;
    batch.states = {state};
    database->save(batch);
    out.document.sessions.push_back(state);
    for (const auto& added : batch.keyframes) {
      const SessionKeyframe& kf = added.keyframe;
      out.document.poses.push_back({{state.id, kf.index}, kf.frame, kf.time, kf.after_failure, kf.session_from_camera});
    }
    for (const StereoConstraint& c : batch.windows.front().constraints)
      out.document.constraints.emplace_back(state.id, c);
    for (const Encounter& e : batch.encounters) out.document.encounters.push_back(e);
  }
  AttachedMap map;
  map.name = "desk";
  map.path = "maps/desk.plxmap";
  map.session = 1;
  map.keyframe = 3;
  map.keyframe_from_map = SimilarityTransform(2.5, exp_so3({0, 0.4, 0}), {3, 2, 1});
  map.agreements = 4;
  database->add_map(&map);
  EXPECT_GT(map.id, 0);
  out.document.maps.push_back(map);
  return out;
}

std::string saved_two_sessions(const MemoryFolder& folder, const std::string& name = "sessions.plx") {
  SessionDatabase database(folder.file(name), SqliteMode::write, "parallax test");
  save_two_sessions(&database);
  return database.path();
}

std::string reading_sessions_fails(const std::string& path) {
  try {
    SessionDatabase(path, SqliteMode::read).read();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(SessionDatabase, HoldsAllToTheLastBit) {
  const MemoryFolder folder;
  const std::string path = folder.file("sessions.plx");
  SavedSessions saved;
  {
    SessionDatabase database(path, SqliteMode::write, "parallax test");
    saved = save_two_sessions(&database);
    expect_same(saved.document, database.read());
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), std::filesystem::directory_iterator()), 1)
      << "nothing is left beside the file";
  SessionDatabase database(path, SqliteMode::read);
  expect_same(saved.document, database.read());
  EXPECT_TRUE(verify_session_database(path).empty()) << verify_session_database(path).front();
  for (const SessionBatch& batch : saved.batches) {
    for (const auto& added : batch.keyframes) {
      const PoseKey key{batch.session, added.keyframe.index};
      expect_same(added.features, database.features(key));
      GreyImage left, right;
      ASSERT_TRUE(database.images(key, &left, &right));
      EXPECT_EQ(cv::norm(left, added.keyframe.left, cv::NORM_INF), 0);
      EXPECT_EQ(cv::norm(right, added.keyframe.right, cv::NORM_INF), 0);
    }
    const std::vector<SessionPoint> points = database.points(batch.session);
    const std::vector<SessionPoint>& expected = batch.windows.front().points;
    ASSERT_EQ(points.size(), expected.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(points[i].keyframe, expected[i].keyframe);
      EXPECT_EQ(points[i].camera, expected[i].camera);
      EXPECT_EQ(points[i].poses, expected[i].poses);
    }
  }
  const std::vector<SessionTiming> timings = database.timings();
  ASSERT_EQ(timings.size(), 2U);
  EXPECT_EQ(timings[0].key, (PoseKey{2, 1}));
  EXPECT_TRUE(timings[0].loop);
  EXPECT_EQ(timings[1].module, SessionModule::window);
  EXPECT_EQ(timings[1].ms, 7);
  ASSERT_TRUE(database.find("tuesday"));
  EXPECT_EQ(database.find("tuesday")->id, 2);
  EXPECT_FALSE(database.find("wednesday"));
  EXPECT_EQ(database.began(1).size(), 20U) << database.began(1);
  EXPECT_EQ(database.began(3), "");
}

TEST(SessionDatabase, ImagesNeedNotBeKept) {
  const MemoryFolder folder;
  SessionFabricator make(4);
  SessionDatabase database(folder.file("a"), SqliteMode::write);
  const SessionState state = database.begin_session(fabricated_start("a"));
  database.save(make.batch(state.id, 2, false));
  GreyImage left, right;
  EXPECT_FALSE(database.images({1, 0}, &left, &right));
  EXPECT_TRUE(verify_session_database(database.path()).empty());
}

// Messages may arrive twice, and a later day goes on where the first one ended.
TEST(SessionDatabase, TheSameAgainIsPassedOver) {
  const MemoryFolder folder;
  const std::string path = folder.file("sessions.plx");
  SavedSessions saved;
  {
    SessionDatabase database(path, SqliteMode::write);
    saved = save_two_sessions(&database);
  }
  SessionDatabase database(path, SqliteMode::write);
  for (SessionBatch batch : saved.batches) {
    batch.keyframes.front().keyframe.session_from_camera = {};  // not taken: it is there
    database.save(batch);
    database.save(batch);
  }
  expect_same(saved.document, database.read());
  EXPECT_EQ(database.points(1).size(), saved.batches[0].windows[0].points.size());

  SessionFabricator make(9);
  const SessionState third = database.begin_session(fabricated_start("monday"));
  EXPECT_EQ(third.id, 3);
  EXPECT_EQ(third.start.name, "monday-2");
  EXPECT_EQ(third.component, 3);
  // A window that overlaps one that is there brings what is new.
  SessionBatch more;
  more.session = 2;
  more.keyframes = {make.keyframe(3), make.keyframe(4)};
  more.windows = {make.window(1, 4)};
  database.save(more);
  const SessionDocument now = database.read();
  ASSERT_EQ(now.constraints.size(), saved.document.constraints.size() + 2);
  EXPECT_EQ(now.constraints[5].second.from_from_to.t, saved.document.constraints[5].second.from_from_to.t);
  EXPECT_TRUE(verify_session_database(path).empty());
}

TEST(SessionDatabase, FollowsWhatChanges) {
  const MemoryFolder folder;
  SessionDatabase database(folder.file("a"), SqliteMode::write);
  SessionDocument expected = save_two_sessions(&database).document;
  SessionFabricator make(6);
  SessionBatch batch;
  expected.poses[2].session_from_camera = make.transform();
  expected.poses[6].session_from_camera = make.transform();
  batch.moved = {expected.poses[2], expected.poses[6]};
  expected.encounters[0].state = EncounterState::off;
  batch.encounters = {expected.encounters[0]};
  expected.sessions[1].component = 2;
  expected.sessions[1].global_from_session = {};
  batch.states = {expected.sessions[1]};
  batch.states[0].start.name = "not taken";
  database.save(batch);
  expect_same(expected, database.read());
  database.rename_session(1, "first floor");
  expected.sessions[0].start.name = "first floor";
  expect_same(expected, database.read());
  EXPECT_THROW(database.rename_session(1, "tuesday"), InputError);
  EXPECT_THROW(database.rename_session(1, "two\nlines"), InputError);
  database.remove_map(expected.maps[0].id);
  expected.maps.clear();
  expect_same(expected, database.read());
  EXPECT_TRUE(verify_session_database(database.path()).empty());
}

// What could not be read again is not written: nothing of the batch is.
TEST(SessionDatabase, ABatchThatIsNotSoundLeavesTheFileAsItWas) {
  const MemoryFolder folder;
  SessionDatabase database(folder.file("a"), SqliteMode::write);
  const SessionDocument before = save_two_sessions(&database).document;
  SessionFabricator make(8);
  const auto refused = [&](const std::function<void(SessionBatch*)>& spoil) {
    SessionBatch batch;
    batch.session = 2;
    batch.keyframes = {make.keyframe(3), make.keyframe(4)};
    batch.windows = {make.window(2, 4)};
    batch.encounters = {make.encounter(database.next_encounter(), {1, 1}, {2, 3}, EncounterState::active)};
    batch.states = {before.sessions[1]};
    spoil(&batch);
    EXPECT_THROW(database.save(batch), CheckFailure);
    expect_same(before, database.read());
  };
  const double nan = std::nan("");
  refused([](SessionBatch* b) { b->session = 7; });
  refused([&](SessionBatch* b) { b->keyframes[1].keyframe.session_from_camera.t.x() = nan; });
  refused([](SessionBatch* b) { b->keyframes[1].keyframe.session_from_camera.R *= 1.01; });
  refused([](SessionBatch* b) { b->keyframes[1].keyframe.session_from_camera.R.col(0) *= -1; });
  refused([](SessionBatch* b) { b->keyframes[1].keyframe.right = GreyImage(); });
  refused([](SessionBatch* b) { b->keyframes[1].features.right_px.pop_back(); });
  refused([](SessionBatch* b) { b->windows[0].constraints[1].covariance(4, 4) = -1; });
  refused([](SessionBatch* b) { b->windows[0].constraints[1].covariance(4, 0) += 1; });
  refused([](SessionBatch* b) { b->windows[0].constraints[1].to = 9; });
  refused([&](SessionBatch* b) { b->windows[0].points[1].camera.z() = static_cast<float>(nan); });
  refused([](SessionBatch* b) { b->encounters[0].found.keyframe = 50; });
  refused([&](SessionBatch* b) { b->encounters[0].bow = nan; });
  refused([](SessionBatch* b) { b->states[0].component = 4; });
  refused([](SessionBatch* b) { b->timings = {{{2, 0}, SessionModule::window, -1, false}}; });
  refused([](SessionBatch* b) { b->moved = {{{2, 11}, 0, Timestamp(0), false, {}}}; });
}

TEST(SessionDatabase, OneWritesAndOthersRead) {
  const MemoryFolder folder;
  const std::string path = saved_two_sessions(folder);
  SessionDatabase writer(path, SqliteMode::write);
  const auto second = [&] {
    try {
      SessionDatabase again(path, SqliteMode::write);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_NE(second().find("another program that writes"), std::string::npos) << second();
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) _exit(second().empty() ? 1 : 0);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0) << "another process";
  SessionDatabase reader(path, SqliteMode::read);
  EXPECT_EQ(reader.read().sessions.size(), 2U);
  writer.begin_session(fabricated_start("third"));
  EXPECT_EQ(reader.read().sessions.size(), 3U);
  EXPECT_THROW(reader.begin_session(fabricated_start("fourth")), CheckFailure);
}

TEST(SessionDatabase, TakesAnothersSessions) {
  const MemoryFolder folder;
  SessionDatabase here(folder.file("here"), SqliteMode::write);
  const SessionDocument first = save_two_sessions(&here, 1).document;
  SessionDatabase there(folder.file("there"), SqliteMode::write);
  const SavedSessions other = save_two_sessions(&there, 2);
  here.erase_session(here.begin_session(fabricated_start("gone")).id);  // its number is used up
  const auto renumbered = here.take(&there);
  EXPECT_EQ(renumbered, (std::vector<std::pair<int, int>>{{1, 4}, {2, 5}}));
  SessionDocument expected = first;
  for (SessionState state : other.document.sessions) {
    state.id += 3;
    state.component += 3;
    state.start.name += "-2";
    expected.sessions.push_back(state);
  }
  for (SessionPose pose : other.document.poses) {
    pose.key.session += 3;
    expected.poses.push_back(pose);
  }
  for (auto constraint : other.document.constraints) {
    constraint.first += 3;
    expected.constraints.push_back(constraint);
  }
  for (Encounter e : other.document.encounters) {
    e.id += 2;
    e.found.session += 3;
    e.query.session += 3;
    expected.encounters.push_back(e);
  }
  expected.maps.push_back(other.document.maps[0]);
  expected.maps.back().id = 2;
  expected.maps.back().session = 4;
  expect_same(expected, here.read());
  expect_same(other.batches[1].keyframes[2].features, here.features({5, 2}));
  GreyImage left, right;
  ASSERT_TRUE(here.images({5, 2}, &left, &right));
  EXPECT_EQ(cv::norm(right, other.batches[1].keyframes[2].keyframe.right, cv::NORM_INF), 0);
  EXPECT_EQ(here.points(4).size(), other.batches[0].windows[0].points.size());
  EXPECT_EQ(here.next_encounter(), 5);
  EXPECT_EQ(here.begin_session(fabricated_start("next")).id, 6);
  EXPECT_TRUE(verify_session_database(here.path()).empty());
}

// The same recording is told by when it began, its source and what its first keyframe saw.
TEST(SessionDatabase, TakesNoSessionTwice) {
  const MemoryFolder folder;
  SessionDatabase there(folder.file("there"), SqliteMode::write);
  save_two_sessions(&there, 2);
  SessionDatabase here(folder.file("here"), SqliteMode::write);
  const auto refused = [&] {
    try {
      here.take(&there);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  ASSERT_EQ(refused(), "");
  here.rename_session(2, "thursday");
  here.erase_session(1);
  const SessionDocument before = here.read();
  EXPECT_EQ(refused(), there.path() + ": session 'tuesday' is in " + here.path() +
                           " already, as 'thursday' (number 2): found the same recording begun at the same time, "
                           "expected sessions that " +
                           here.path() + " has not");
  expect_same(before, here.read());
  EXPECT_TRUE(verify_session_database(here.path()).empty());
  // Begun at the same time, of the same source, but something else was seen.
  SessionFabricator make(3);
  there.truncate_session(2, 0);
  EXPECT_NO_THROW(here.expect_new_sessions(&there));
  there.save(make.batch(2, 2, false));
  EXPECT_NO_THROW(here.expect_new_sessions(&there));
  here.truncate_session(2, 0);
  EXPECT_NO_THROW(here.expect_new_sessions(&there));
  there.truncate_session(2, 0);
  EXPECT_THROW(here.expect_new_sessions(&there), InputError) << "neither has seen anything";
  here.erase_session(2);
  EXPECT_EQ(refused(), "");
  // Alike in all but the source, and begun in the same second as a rule.
  SessionDatabase one(folder.file("one"), SqliteMode::write), two(folder.file("two"), SqliteMode::write);
  for (SessionDatabase* database : {&one, &two}) {
    SessionStart start = fabricated_start("walk");
    if (database == &two) start.source = "another camera";
    database->save(SessionFabricator(5).batch(database->begin_session(start).id, 2, false));
  }
  EXPECT_NO_THROW(one.expect_new_sessions(&two));
}

TEST(SessionDatabase, ASessionGoesWithAllThatHangsOnIt) {
  const MemoryFolder folder;
  const std::string path = folder.file("a");
  SessionDatabase database(path, SqliteMode::write);
  save_two_sessions(&database);
  SessionFabricator make(3);
  SessionState third = database.begin_session(fabricated_start("wednesday"));
  SessionBatch batch = make.batch(third.id, 3);
  // The third met the second, which met the first: without the second they part; without the first two stay together.
  batch.encounters = {make.encounter(database.next_encounter(), {2, 0}, {3, 1}, EncounterState::active)};
  third.component = 1;
  third.global_from_session = make.transform();
  batch.states = {third};
  database.save(batch);
  const SessionDocument before = database.read();
  const std::int64_t next = database.next_encounter();
  database.erase_session(1);
  const SessionDocument after = database.read();
  ASSERT_EQ(after.sessions.size(), 2U);
  EXPECT_EQ(after.sessions[0].component, 2);
  EXPECT_EQ(after.sessions[1].component, 2);
  EXPECT_TRUE(after.sessions[0].global_from_session.t.isZero());
  const RigidTransform expected =
      before.sessions[1].global_from_session.inverse() * before.sessions[2].global_from_session;
  EXPECT_LT((after.sessions[1].global_from_session.t - expected.t).norm(), 1e-12);
  EXPECT_LT((after.sessions[1].global_from_session.R - expected.R).norm(), 1e-12);
  ASSERT_EQ(after.encounters.size(), 1U);
  EXPECT_EQ(after.encounters[0].id, before.encounters[2].id);
  EXPECT_TRUE(after.maps.empty());
  EXPECT_EQ(after.poses.size(), 6U);
  EXPECT_TRUE(database.points(1).empty());
  EXPECT_EQ(database.next_encounter(), next);
  database.compact();  // what the log holds is in the file, and what was given back is cut off
  const auto bytes = std::filesystem::file_size(path);
  expect_same(after, database.read());
  EXPECT_TRUE(verify_session_database(path).empty()) << verify_session_database(path).front();
  database.erase_session(2);
  EXPECT_EQ(database.read().sessions[0].component, 3);
  database.compact();
  EXPECT_LT(std::filesystem::file_size(path), bytes - 8192);
  database.erase_session(3);
  EXPECT_TRUE(database.read().sessions.empty());
  EXPECT_EQ(database.begin_session(fabricated_start("a")).id, 4);
}

TEST(SessionDatabase, OtherFilesAreRefusedInOneLine) {
  const MemoryFolder folder;
  const std::string text =
      folder.write("notes.txt", "these are notes, and long enough to be taken for a database, though");
  EXPECT_NE(reading_sessions_fails(text).find("notes.txt"), std::string::npos);
  EXPECT_NE(reading_sessions_fails(folder.file("absent")).find("absent"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder.file("absent"))) << "reading makes no file";
  EXPECT_THROW(SessionDatabase(text, SqliteMode::write), InputError);
  EXPECT_THROW(SessionDatabase(folder.path().string(), SqliteMode::write), InputError);
  EXPECT_THROW(SessionDatabase(folder.file("no/folder/a"), SqliteMode::write), RunError);
  const std::string other = folder.file("other.db");
  database_sql(other, "CREATE TABLE recipes(name TEXT)");
  EXPECT_NE(reading_sessions_fails(other).find("another program's database"), std::string::npos);
  EXPECT_THROW(SessionDatabase(other, SqliteMode::write), InputError);
  database_sql(other, "PRAGMA application_id = 0x504c584d");
  EXPECT_NE(reading_sessions_fails(other).find("found a map file"), std::string::npos);
  const std::string later = saved_two_sessions(folder);
  database_sql(later, "PRAGMA user_version = 9");
  EXPECT_NE(reading_sessions_fails(later).find("version 9"), std::string::npos) << reading_sessions_fails(later);
  EXPECT_THROW(SessionDatabase(later, SqliteMode::write), InputError);
}

// Each kind of damage is named by verifying; by reading too where reading comes by it.
TEST(SessionDatabase, DamageIsNamed) {
  const MemoryFolder folder;
  const struct {
    const char *sql, *named;
    bool read_sees_it = true;
  } damages[] = {
      {"UPDATE session SET source = 'another' WHERE id = 2", "session 2"},
      {"UPDATE keyframe SET frame = 99 WHERE session = 2 AND keyframe = 1", "session 2, keyframe 1"},
      {"UPDATE pose SET session_from_camera = zeroblob(96) WHERE keyframe = 4", "session 1, keyframe 4"},
      {"UPDATE edge SET covariance = x'00' WHERE session = 1 AND first = 2", "session 1, keyframe 2"},
      {"UPDATE encounter SET state = 'off' WHERE id = 1", "encounter 1"},
      {"UPDATE attached_map SET keyframe = 2", "attached map 1"},
      {"UPDATE meta SET value = '9' WHERE key = 'rows edge'", "meta 'rows edge'"},
      {"DELETE FROM keyframe WHERE session = 1 AND keyframe = 4", "keyframe: found 7 rows, expected 8"},
      {"DELETE FROM pose WHERE session = 2 AND keyframe = 0", "pose: found 7 rows"},
      {"DELETE FROM edge WHERE session = 1 AND first = 0", "edge: found 5 rows, expected 6"},
      {"DELETE FROM encounter WHERE id = 2", "encounter: found 1 rows"},
      {"DELETE FROM session WHERE id = 2", "session: found 1 rows"},
      {"DROP TABLE timing", "timing"},
      {"CREATE VIEW extra AS SELECT * FROM pose", "extra"},
      {"UPDATE feature SET features = zeroblob(45) WHERE session = 1 AND keyframe = 1", "session 1, keyframe 1", false},
      {"DELETE FROM feature WHERE session = 1 AND keyframe = 1", "session 1, keyframe 1", false},
      {"UPDATE image SET left_grey = zeroblob(9) WHERE session = 2 AND keyframe = 2", "session 2, keyframe 2", false},
      {"DELETE FROM image WHERE session = 2 AND keyframe = 2", "session 2, keyframe 2", false},
      {"UPDATE point SET last = 9 WHERE session = 2", "session 2", false},
      {"DELETE FROM point WHERE session = 2", "point: found 1 rows", false},
      {"UPDATE timing SET ms = 3.5", "session 2, keyframe 1", false},
  };
  const std::string whole = saved_two_sessions(folder, "whole");
  const std::string path = folder.file("damaged");
  for (const auto& damage : damages) {
    SCOPED_TRACE(damage.sql);
    std::filesystem::copy_file(whole, path, std::filesystem::copy_options::overwrite_existing);
    database_sql(path, damage.sql);
    if (damage.read_sees_it) {
      const std::string said = reading_sessions_fails(path);
      EXPECT_NE(said.find(damage.named), std::string::npos) << said;
      EXPECT_EQ(said.rfind(path + ": ", 0), 0U) << said;
    }
    const std::vector<std::string> lines = verify_session_database(path);
    ASSERT_FALSE(lines.empty());
    std::string all;
    for (const std::string& line : lines) all += line + "; ";
    EXPECT_NE(all.find(damage.named), std::string::npos) << all;
  }
}

// Whatever byte is damaged: reading gives the very document that was saved, or says what is wrong.
TEST(SessionDatabase, NoDamagedByteGivesAnotherDocument) {
  const MemoryFolder folder;
  const std::string whole = testing::read_all(saved_two_sessions(folder, "whole"));
  const SessionDocument expected = SessionDatabase(folder.file("whole"), SqliteMode::read).read();
  std::mt19937_64 rng(5);
  int named = 0, unharmed = 0;
  for (int round = 0; round < 150; ++round) {
    std::string damaged = whole;
    for (int i = 0; i <= round % 3; ++i) damaged[rng() % damaged.size()] ^= static_cast<char>(1U << (rng() % 8));
    if (round % 10 == 9) damaged.resize(rng() % damaged.size());
    const std::string name = folder.write("damaged", damaged);
    const std::string said = reading_sessions_fails(name);
    if (said.empty()) {
      ++unharmed;
      expect_same(expected, SessionDatabase(name, SqliteMode::read).read());
      continue;
    }
    ++named;
    EXPECT_FALSE(verify_session_database(name).empty()) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
  EXPECT_GT(named, 30);
  EXPECT_GT(unharmed, 10) << "images, and space that is not used";
}

}  // namespace
}  // namespace parallax
