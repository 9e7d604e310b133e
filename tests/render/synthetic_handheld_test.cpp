// The hand-held synthetic camera: exact truth, determinism of a script, obedience to the hand.
#include "render/synthetic_handheld.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <thread>

#include "core/error.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

constexpr const char* kSmall = "desk?size=160x120";

HandheldOptions stepped() {
  HandheldOptions options;
  options.realtime = false;
  options.threads = 1;
  return options;
}

std::vector<Frame> take(SyntheticHandheld* camera, int count) {
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i)
    if (auto frame = camera->next()) frames.push_back(std::move(*frame));
  return frames;
}

TEST(SyntheticHandheldTest, OwnPathIsTheSequenceItself) {
  SyntheticHandheld camera(std::string(kSmall) + "&path=own", stepped());
  SourceOptions colour;
  colour.colour = true;
  const auto source = open_synthetic_source(kSmall, colour);
  for (int i = 0; i < 3; ++i) {
    const auto live = camera.next();
    const auto recorded = source->next();
    ASSERT_TRUE(live && recorded);
    EXPECT_EQ(cv::norm(live->grey, recorded->grey, cv::NORM_INF), 0) << i;
    EXPECT_EQ(cv::norm(live->colour, recorded->colour, cv::NORM_INF), 0) << i;
    EXPECT_EQ(live->index, i);
  }
  const auto truth = camera.ground_truth();
  ASSERT_EQ(truth.size(), 3u);
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(truth[static_cast<std::size_t>(i)].world_from_camera.t, source->world_from_camera(i).t);
}

TEST(SyntheticHandheldTest, OwnPathEndsWithTheSequence) {
  SyntheticHandheld camera(std::string(kSmall) + "&path=own&frames=2", stepped());
  EXPECT_EQ(take(&camera, 5).size(), 2u);
}

TEST(SyntheticHandheldTest, ScriptedFramesRepeatToTheLastBit) {
  const ScratchFolder folder;
  const std::string file =
      folder.write("walk.txt", "0 -0.05 -0.43 0.47 0.9 0 0 -0.42\n0.2 0.05 -0.43 0.47 0.9 0 0 -0.42\n");
  const std::string name = std::string(kSmall) + "&path=" + file;
  SyntheticHandheld a(name, stepped()), b(name, stepped());
  const auto first = take(&a, 8), second = take(&b, 8);
  ASSERT_EQ(first.size(), 8u);
  ASSERT_EQ(second.size(), 8u);
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_EQ(cv::norm(first[i].grey, second[i].grey, cv::NORM_INF), 0) << i;
  // Between the poses of the file, straight and at an even pace; behind the last one it stays.
  const auto truth = a.ground_truth();
  EXPECT_NEAR(truth[3].world_from_camera.t.x(), 0.0, 1e-9);
  EXPECT_NEAR(truth[7].world_from_camera.t.x(), 0.05, 1e-12);
}

TEST(SyntheticHandheldTest, HandSlidesTurnsAndComesToRest) {
  SyntheticHandheld camera(kSmall, stepped());
  take(&camera, 3);
  const RigidTransform before = camera.ground_truth().back().world_from_camera;
  camera.hand().set_velocity({0.1, 0, 0});
  take(&camera, 30);
  camera.hand().set_velocity(Eigen::Vector3d::Zero());
  take(&camera, 30);
  const RigidTransform slid = camera.ground_truth().back().world_from_camera;
  // Ten centimetres to the right of the image, whatever the inertia; a few millimetres of tremor.
  EXPECT_NEAR(((before.inverse() * slid).t - Eigen::Vector3d(0.1, 0, 0)).norm(), 0, 0.006);
  EXPECT_LT((before.inverse() * slid).angle(), 0.02);
  camera.hand().turn(0.3, 0.1);
  camera.hand().push(0.05);
  take(&camera, 40);
  const RigidTransform turned = camera.ground_truth().back().world_from_camera;
  EXPECT_NEAR((slid.inverse() * turned).angle(), std::hypot(0.3, 0.1), 0.015);
  EXPECT_NEAR((turned.t - slid.t).norm(), 0.05, 0.006);
  // At rest only the tremor is left.
  const auto truth = camera.ground_truth();
  EXPECT_LT((truth[truth.size() - 1].world_from_camera.t - truth[truth.size() - 2].world_from_camera.t).norm(), 0.002);
}

TEST(SyntheticHandheldTest, MotionHasNoJumps) {
  HandMotion hand{HandMotion::State{}};
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  for (int i = 0; i < 200; ++i) {
    HandControl::Wish wish;
    wish.velocity = Eigen::Vector3d(i % 40 < 20 ? 0.3 : -0.3, 0, 0);
    hand.advance(wish, 0.002);
    // 0.6 m/s of change with a time constant of 0.12 s is at most 5 m/s^2.
    EXPECT_LT((hand.state().velocity - velocity).norm(), 0.002 * 5.01);
    velocity = hand.state().velocity;
  }
}

TEST(SyntheticHandheldTest, StaysWithinReach) {
  HandMotion hand{HandMotion::State{}};
  HandControl::Wish wish;
  wish.velocity = {0, 0, 1};
  for (int i = 0; i < 300; ++i) hand.advance(wish, 1.0 / 30);
  EXPECT_GE(hand.state().position.z(), 0.05);
  EXPECT_TRUE(hand.state().position.allFinite());
}

TEST(SyntheticHandheldTest, CalibrationMayBeUnknown) {
  EXPECT_TRUE(SyntheticHandheld(kSmall, stepped()).calibration().has_value());
  EXPECT_FALSE(SyntheticHandheld(std::string(kSmall) + "&calibration=none", stepped()).calibration().has_value());
}

TEST(SyntheticHandheldTest, StopWakesWhoWaits) {
  HandheldOptions options = stepped();
  options.realtime = true;
  SyntheticHandheld camera(kSmall, options);
  std::jthread stopper;
  int frames = 0;
  while (auto frame = camera.next()) {
    if (++frames == 3) stopper = std::jthread([&] { camera.stop(); });
    ASSERT_LT(frames, 1000);
  }
  EXPECT_GE(frames, 3);
  EXPECT_FALSE(camera.next().has_value());
}

TEST(SyntheticHandheldTest, BadNamesAreOneLine) {
  for (const char* name : {"nowhere", "desk?path=", "desk?path=/nonexistent/walk.txt", "desk?calibration=perhaps",
                           "desk?path=hand&colour=1"}) {
    try {
      SyntheticHandheld camera(name, stepped());
      ADD_FAILURE() << name << " was accepted";
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
  }
}

}  // namespace
}  // namespace parallax::testing
