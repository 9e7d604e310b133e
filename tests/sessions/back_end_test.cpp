#include "sessions/back_end.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "sessions/back_end_worker.h"
#include "tests/sessions/simulated_sessions.h"

namespace parallax {
namespace {

using testing::simulate_session;
using testing::SimulatedSession;

std::shared_ptr<const Vocabulary> words() {
  static const auto vocabulary = std::make_shared<const Vocabulary>(
      Vocabulary::load(std::string(PARALLAX_SOURCE_DIR) + "/assets/vocabulary/places.plxvoc"));
  return vocabulary;
}

struct BackEndOfBlankWalls : ::testing::Test {
  std::string path = (std::filesystem::temp_directory_path() / ("back_end_" + std::to_string(getpid()) + ".plxs"));
  SimulatedSession walk = simulate_session(1, 20, 0, 1, 3);
  SessionStart start;

  void SetUp() override {
    start.name = "walk";
    start.source = "simulated";
    start.camera = {64, 48, {60, 60}, {31.5, 23.5}, 0.1};
  }
  void TearDown() override { std::filesystem::remove(path); }

  SessionKeyframe keyframe(int index) const {
    SessionKeyframe out;
    out.index = index;
    out.frame = 4 * index;
    out.time = from_seconds(0.2 * index);
    out.session_from_camera = walk.session_from_camera(index);
    out.left = GreyImage(48, 64, std::uint8_t{90});
    out.right = out.left;
    return out;
  }
  SessionWindow window(int from, int to) const {
    SessionWindow out;
    for (int i = from; i < to; ++i) out.constraints.push_back(walk.constraints[static_cast<std::size_t>(i)]);
    out.points.push_back({from, {0.f, 0.f, 2.f}, 3});
    return out;
  }
  static std::unique_ptr<BackEnd> make(SessionDatabase* database) {
    return std::make_unique<BackEnd>(database, words(), CrfModel(), BackEndOptions());
  }
};

TEST_F(BackEndOfBlankWalls, MessagesThatComeTwiceChangeNothing) {
  const auto back_end = make(nullptr);
  const int session = back_end->begin(start).id;
  for (int i = 0; i < 6; ++i) {
    back_end->add(session, keyframe(i));
    EXPECT_EQ(back_end->add(session, keyframe(i)).keyframes, i + 1);
  }
  EXPECT_EQ(back_end->add(session, window(0, 4)).in_graph, 5);
  EXPECT_EQ(back_end->add(session, window(0, 4)).in_graph, 5);
  EXPECT_EQ(back_end->add(session, window(2, 5)).in_graph, 6);
  EXPECT_EQ(back_end->view().poses.size(), 6u);
}

TEST_F(BackEndOfBlankWalls, WhatDoesNotContinueIsRefusedAndChangesNothing) {
  const auto back_end = make(nullptr);
  const int session = back_end->begin(start).id;
  back_end->add(session, keyframe(0));
  EXPECT_THROW(back_end->add(session, keyframe(2)), InputError);
  EXPECT_THROW(back_end->add(session, window(0, 1)), InputError);  // keyframe 1 has not arrived
  EXPECT_THROW(back_end->add(session + 1, keyframe(1)), InputError);
  SessionKeyframe small = keyframe(1);
  small.right = GreyImage(47, 64, std::uint8_t{0});
  EXPECT_THROW(back_end->add(session, small), InputError);
  SessionKeyframe skewed = keyframe(1);
  skewed.session_from_camera.R(0, 0) = 3;
  EXPECT_THROW(back_end->add(session, skewed), InputError);
  EXPECT_EQ(back_end->add(session, keyframe(1)).keyframes, 2);
  SessionWindow wrong = window(0, 1);
  wrong.constraints[0].covariance(2, 2) = -1;
  EXPECT_THROW(back_end->add(session, wrong), InputError);
  EXPECT_EQ(back_end->add(session, window(0, 1)).in_graph, 2);
}

TEST_F(BackEndOfBlankWalls, GoesOnFromTheDatabase) {
  std::vector<SessionPose> before;
  {
    SessionDatabase database(path, SqliteMode::write);
    const auto back_end = make(&database);
    const int session = back_end->begin(start).id;
    for (int i = 0; i < 12; ++i) back_end->add(session, keyframe(i));
    back_end->add(session, window(0, 8));
    back_end->save();
    before = back_end->view().poses;
  }
  SessionDatabase database(path, SqliteMode::write);
  const auto back_end = make(&database);
  const auto after = back_end->view().poses;
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_EQ(after[i].key, before[i].key);
    EXPECT_LT((after[i].session_from_camera.inverse() * before[i].session_from_camera).log().norm(), 1e-7);
  }
  // A front end that was killed goes on with the last keyframe that was handed over.
  SessionPose last;
  const auto state = back_end->resume("walk", &last);
  ASSERT_TRUE(state);
  EXPECT_EQ(last.key.keyframe, 8);
  EXPECT_EQ(last.frame, 32);
  EXPECT_EQ(back_end->add(state->id, keyframe(9)).keyframes, 10);
  EXPECT_EQ(back_end->add(state->id, window(8, 9)).in_graph, 10);
  back_end->end(state->id);
  EXPECT_FALSE(back_end->resume("another", &last));
  const SessionDocument document = database.read();
  ASSERT_EQ(document.sessions.size(), 1u);
  EXPECT_TRUE(document.sessions[0].ended);
  EXPECT_EQ(document.poses.size(), 10u);
  EXPECT_EQ(document.constraints.size(), 9u);
}

// What passes for a covariance with the one must not stop the other: nothing that arrives may end the back end.
TEST_F(BackEndOfBlankWalls, CovariancesThatAreNoneAreRefused) {
  SessionDatabase database(path, SqliteMode::write);
  const auto back_end = make(&database);
  const int session = back_end->begin(start).id;
  for (int i = 0; i < 3; ++i) back_end->add(session, keyframe(i));
  SessionWindow askew = window(0, 1), sure = window(0, 1), far = window(0, 1);
  askew.constraints[0].covariance = 1e6 * Matrix6d::Identity();
  askew.constraints[0].covariance(4, 4) = askew.constraints[0].covariance(5, 5) = 1;
  askew.constraints[0].covariance(4, 5) = 0.5;  // beside the others' size as good as symmetric
  sure.constraints[0].covariance *= 1e-30;
  far.constraints[0].from_from_to.t.x() = 1e13;
  for (const SessionWindow* wrong : {&askew, &sure, &far}) EXPECT_THROW(back_end->add(session, *wrong), InputError);
  EXPECT_THROW(back_end->add({{{session + 7, 0}, SessionModule::window, 1.0, false}}), InputError);
  SessionStart blind = start;
  blind.camera.focal_px.x() = 0;
  EXPECT_THROW(back_end->begin(blind), InputError);
  EXPECT_EQ(back_end->add(session, window(0, 2)).in_graph, 3);
}

// Two sessions of one walk, along walls that look like nothing else. The back end ends while the second session's
// encounters wait for its window; nobody sends those keyframes again.
TEST_F(BackEndOfBlankWalls, EncountersThatWaitForTheirWindowOutliveTheBackEnd) {
  constexpr int kCount = 12, kDisparity = 12;
  start.camera = {320, 240, {300, 300}, {159.5, 119.5}, 0.12};
  const auto wall = [&](int index) {
    std::mt19937 rng(static_cast<unsigned>(index));
    cv::Mat1b blocks(30 + 2, 40 + 4);
    for (auto& value : blocks) value = static_cast<std::uint8_t>(rng() % 256);
    cv::Mat1b wide;
    cv::resize(blocks, wide, {}, 8, 8, cv::INTER_NEAREST);
    SessionKeyframe out = keyframe(index);
    out.left = GreyImage(wide(cv::Rect(kDisparity, 0, 320, 240)).clone());
    out.right = GreyImage(wide(cv::Rect(2 * kDisparity, 0, 320, 240)).clone());
    return out;
  };
  {
    SessionDatabase database(path, SqliteMode::write);
    const auto back_end = make(&database);
    const int first = back_end->begin(start).id;
    for (int i = 0; i < kCount; ++i) back_end->add(first, wall(i));
    back_end->add(first, window(0, kCount - 1));
    back_end->end(first);
    const int second = back_end->begin(start).id;
    for (int i = 0; i < kCount; ++i) back_end->add(second, wall(i));
    back_end->save();
    EXPECT_TRUE(back_end->graph().component(second) == second);
  }
  SessionDatabase database(path, SqliteMode::write);
  const auto back_end = make(&database);
  const BackEndAnswer answer = back_end->add(2, window(0, kCount - 1));
  ASSERT_EQ(answer.meetings.size(), 1u);
  EXPECT_EQ(answer.meetings[0].other, start.name);
  EXPECT_EQ(answer.component, 1);
  EXPECT_LT(answer.global_from_session.log().norm(), 0.05);
}

TEST_F(BackEndOfBlankWalls, NamesAreMadeUnique) {
  const auto back_end = make(nullptr);
  EXPECT_EQ(back_end->begin(start).start.name, "walk");
  EXPECT_EQ(back_end->begin(start).start.name, "walk-2");
}

TEST_F(BackEndOfBlankWalls, TwoFrontEndsShareTheWorker) {
  BackEndWorker worker(make(nullptr));
  {
    std::vector<std::jthread> front_ends;
    for (int k = 0; k < 2; ++k)
      front_ends.emplace_back([&] {
        const auto link = worker.make_link();
        link->begin(start, false);
        for (int i = 0; i < 20; ++i) link->add(keyframe(i));
        link->add(window(0, 19));
        link->end();
        link->wait();
        EXPECT_EQ(link->take_answers().size(), 21u);
      });
  }
  worker.ask([](BackEnd& back_end) { EXPECT_EQ(back_end.view().poses.size(), 40u); });
}

TEST_F(BackEndOfBlankWalls, WhatTheBackEndThrowsReachesTheFrontEnd) {
  BackEndWorker worker(make(nullptr));
  const auto link = worker.make_link();
  link->begin(start, false);
  link->add(keyframe(3));
  EXPECT_THROW(link->wait(), InputError);
  EXPECT_THROW(link->add(keyframe(0)), InputError);
}

}  // namespace
}  // namespace parallax
