#include "tracker/initialisation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "tests/support/rendered_views.h"
#include "tracker/frame_features.h"

namespace parallax {
namespace {

using test::RenderedViews;

constexpr int kSlideFrames = 10;

// Ten frames along the table, 1 cm apart.
RenderedViews& sliding() {
  static RenderedViews views(test::slide(kSlideFrames, 0.01));
  return views;
}

class InitialisationTest : public ::testing::Test {
 protected:
  explicit InitialisationTest(bool automatic = false, std::size_t capacity = 4)
      : inbox_(capacity),
        initialisation_(sliding().camera(), TrackerOptions(), automatic, &schedule_),
        features_(sliding().camera().width(), sliding().camera().height(), TrackerOptions()) {}

  Initialisation::Step step(const Frame& frame, bool key = false) {
    return initialisation_.step(frame, features_.compute(frame.grey), key, map_, [this](const auto& images) {
      ++given_away_;
      features_.give_away(images);
    });
  }
  Initialisation::Step step(int i, bool key = false) { return step(sliding().frame(i), key); }

  std::optional<InitialisationRequest> requested() {
    auto message = inbox_.try_pop();
    if (!message) return std::nullopt;
    EXPECT_TRUE(std::holds_alternative<InitialisationRequest>(*message));
    return std::get<InitialisationRequest>(std::move(*message));
  }

  MapperInbox inbox_;
  SharedMap shared_;
  LiveTrackerSchedule schedule_{&shared_, &inbox_};
  Initialisation initialisation_;
  FrameFeatures features_;
  TrackingSnapshot map_;
  int given_away_ = 0;
};

TEST_F(InitialisationTest, WaitsForTheKeyAndSaysSo) {
  for (int i = 0; i < 3; ++i) {
    const auto s = step(i);
    EXPECT_EQ(s.state, TrackingState::waiting);
    EXPECT_FALSE(s.message.empty());
    EXPECT_FALSE(s.first_pose);
    EXPECT_TRUE(initialisation_.trails_for_drawing().empty());
  }
}

TEST_F(InitialisationTest, TwoPressesGiveTheMapperMatchesThatAreRight) {
  EXPECT_EQ(step(0, true).state, TrackingState::trailing);
  for (int i = 1; i < 8; ++i) {
    EXPECT_EQ(step(i).state, TrackingState::trailing);
    EXPECT_FALSE(initialisation_.trails_for_drawing().empty());
  }
  EXPECT_FALSE(requested());
  EXPECT_EQ(step(8, true).state, TrackingState::initialising);
  const auto request = requested();
  ASSERT_TRUE(request);
  EXPECT_FALSE(request->automatic);
  EXPECT_EQ(request->first_frame, 0);
  EXPECT_EQ(request->second_frame, 8);
  EXPECT_EQ(request->first_time, sliding().time_of(0));
  EXPECT_EQ(request->second_time, sliding().time_of(8));
  EXPECT_EQ(given_away_, 2) << "the mapper's frames are never written again";
  ASSERT_GT(request->matches.size(), 100U);
  std::vector<double> errors;
  for (const TrailMatch& m : request->matches) {
    const auto place = sliding().seen(0, m.first);
    const auto pixel = place ? sliding().project_visible(8, *place, 0) : std::nullopt;
    if (pixel) errors.push_back((*pixel - m.second).norm());
  }
  ASSERT_GT(errors.size(), 0.8 * static_cast<double>(request->matches.size()));
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.25) << "level-0 pixels";
  EXPECT_LT(errors[errors.size() * 85 / 100], 1.0);
}

TEST_F(InitialisationTest, ARefusalIsSaidAndTheKeyCanBePressedAgain) {
  step(0, true);
  for (int i = 1; i < 4; ++i) step(i);
  step(4, true);
  auto request = requested();
  ASSERT_TRUE(request);
  EXPECT_EQ(step(5).state, TrackingState::initialising) << "no answer yet";
  EXPECT_EQ(step(5, true).state, TrackingState::initialising) << "one question at a time";
  EXPECT_FALSE(requested());
  InitialisationReply refusal;
  refusal.reason = "too little parallax";
  request->reply.set_value(refusal);
  const auto refused = step(6);
  EXPECT_EQ(refused.state, TrackingState::trailing);
  EXPECT_EQ(refused.message, "too little parallax");
  EXPECT_FALSE(refused.first_pose);
  EXPECT_EQ(step(7).message, "") << "said once";
  EXPECT_EQ(step(8, true).state, TrackingState::initialising);
  const auto again = requested();
  ASSERT_TRUE(again);
  EXPECT_EQ(again->first_frame, 0) << "the trails go on from the first press";
  EXPECT_EQ(again->second_frame, 8);
}

TEST_F(InitialisationTest, OnceTheMapIsThereTheFirstPoseIsThisFrames) {
  step(0, true);
  for (int i = 1; i < 8; ++i) step(i);
  step(8, true);
  auto request = requested();
  ASSERT_TRUE(request);
  // The mapper's part, with true places.
  Map map;
  Keyframe kf;
  kf.camera_from_world = sliding().camera_from_world(0);
  kf.images = request->first;
  const KeyframeId first = map.keyframes.insert(kf);
  InitialisationReply reply;
  reply.ok = true;
  reply.second_from_world = sliding().camera_from_world(8);
  for (const TrailMatch& m : request->matches) {
    const auto place = sliding().seen(0, m.first);
    MapPoint p;
    if (!place || !set_source(&p, first, 0, m.first, sliding().camera())) continue;
    p.position = *place;
    p.normal = -(kf.camera_from_world.R.transpose() * p.source_rays.col(0)).normalized();
    reply.point_of_trail.emplace_back(m.trail, map.points.insert(p));
  }
  request->reply.set_value(reply);
  EXPECT_EQ(step(8).state, TrackingState::initialising) << "said to be there, and not published yet";
  map_ = *make_snapshot(map);
  const auto s = step(9);
  EXPECT_EQ(s.state, TrackingState::tracking);
  ASSERT_TRUE(s.first_pose);
  EXPECT_LT(test::centre_distance(*s.first_pose, sliding().camera_from_world(9)), 0.002)
      << "not the second frame's, 1 cm away";
  EXPECT_LT(test::turn_between(*s.first_pose, sliding().camera_from_world(9)), 0.003);
  EXPECT_TRUE(initialisation_.trails_for_drawing().empty());
}

// The user resets between the mapper's answer and the next frame.
TEST_F(InitialisationTest, AMapThatIsGoneAgainIsNotWaitedFor) {
  step(0, true);
  for (int i = 1; i < 4; ++i) step(i);
  step(4, true);
  auto request = requested();
  ASSERT_TRUE(request);
  InitialisationReply reply;
  reply.ok = true;
  request->reply.set_value(reply);
  EXPECT_EQ(step(5).state, TrackingState::initialising);
  EXPECT_EQ(step(6).state, TrackingState::waiting);
  EXPECT_EQ(step(7, true).state, TrackingState::trailing) << "the key starts anew";
  EXPECT_EQ(step(8, true).state, TrackingState::initialising);
  EXPECT_TRUE(requested());
}

TEST_F(InitialisationTest, ResetForgetsTheTrails) {
  step(0, true);
  step(1);
  initialisation_.reset();
  EXPECT_TRUE(initialisation_.trails_for_drawing().empty());
  EXPECT_EQ(step(2).state, TrackingState::waiting);
}

TEST_F(InitialisationTest, APictureWithoutTextureSendsTheUserBack) {
  Frame blank;
  blank.grey = GreyImage(240, 320, static_cast<std::uint8_t>(100));
  step(blank, true);
  blank.index = 1;
  const auto s = step(blank);
  EXPECT_EQ(s.state, TrackingState::waiting);
  EXPECT_FALSE(s.message.empty());
  EXPECT_FALSE(requested());
}

class FullInboxTest : public InitialisationTest {
 protected:
  FullInboxTest() : InitialisationTest(false, 1) {}
};

TEST_F(FullInboxTest, APressTheMapperHasNoRoomForCanBeRepeated) {
  MapperMessage other = PointCounts();
  ASSERT_TRUE(inbox_.try_push(other));
  step(0, true);
  for (int i = 1; i < 6; ++i) step(i);
  EXPECT_EQ(step(6, true).state, TrackingState::trailing);
  ASSERT_TRUE(inbox_.try_pop());
  EXPECT_EQ(step(7, true).state, TrackingState::initialising);
  EXPECT_TRUE(requested());
}

class AutomaticTest : public InitialisationTest {
 protected:
  AutomaticTest() : InitialisationTest(true) {}
};

TEST_F(AutomaticTest, AsksOnceTheImageHasMovedEnough) {
  EXPECT_EQ(step(0).state, TrackingState::trailing);
  int asked_at = -1;
  for (int i = 1; i < kSlideFrames && asked_at < 0; ++i)
    if (step(i).state == TrackingState::initialising) asked_at = i;
  ASSERT_GT(asked_at, 1);
  auto request = requested();
  ASSERT_TRUE(request);
  EXPECT_TRUE(request->automatic);
  EXPECT_EQ(request->second_frame, asked_at);
  // Refused: it asks again by itself when the trails have grown.
  InitialisationReply refusal;
  refusal.reason = "no";
  request->reply.set_value(refusal);
  bool again = false;
  for (int i = asked_at + 1; i < kSlideFrames; ++i) again = step(i).state == TrackingState::initialising || again;
  EXPECT_TRUE(again);
}

TEST_F(AutomaticTest, ACameraAtRestAsksForNothing) {
  Frame still = sliding().frame(0);
  for (int i = 0; i < 8; ++i) {
    still.index = i;
    EXPECT_EQ(step(still).state, TrackingState::trailing);
  }
  EXPECT_FALSE(requested());
}

TEST_F(AutomaticTest, NothingToSeeAsksForNothing) {
  Frame blank;
  blank.grey = GreyImage(240, 320, static_cast<std::uint8_t>(100));
  for (int i = 0; i < 8; ++i) {
    blank.index = i;
    EXPECT_FALSE(step(blank).first_pose);
  }
  EXPECT_FALSE(requested());
}

}  // namespace
}  // namespace parallax
