// Time and tracking into ticks, with a game that only counts.
#include "games/game_runner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace parallax {
namespace {

class CountingGame final : public Game {
 public:
  const GameInfo& info() const override { return info_; }
  void start(const PlayingField&, const GameOptions&) override { steps = 0; }
  void change_field(const PlayingField& field) override { radius_m = field.radius_m; }
  void set(const std::string&, double) override {}
  void step(const GameInput& input) override {
    ++steps;
    scripted_steps += input.act ? 1 : 0;
    poses += input.camera_from_plane ? 1 : 0;
  }
  GameInput scripted_input(const std::optional<RigidTransform>& pose) const override {
    GameInput input;
    input.act = true;
    input.camera_from_plane = pose;
    return input;
  }
  bool is_over() const override { return steps >= ends_at; }
  GameHud hud() const override { return {}; }
  std::vector<GameSound> take_sounds() override { return {}; }
  void draw(const ModelSet&, DrawList*) const override {}
  std::string save() const override { return "{}"; }
  void restore(const std::string&, const PlayingField&) override {}
  std::uint64_t state_hash() const override { return static_cast<std::uint64_t>(steps); }

  int steps = 0, scripted_steps = 0, poses = 0, ends_at = std::numeric_limits<int>::max();
  double radius_m = 0;

 private:
  GameInfo info_;
};

class Runner : public ::testing::Test {
 protected:
  Runner() : runner_(std::make_unique<CountingGame>()), game_(static_cast<CountingGame&>(runner_.game())) {
    seen_.camera_from_plane = RigidTransform();
  }
  void frames(int n, const GameInput& input, double seconds = 1.0 / 30) {
    for (int i = 0; i < n; ++i) runner_.advance(seconds, input);
  }

  GameRunner runner_;
  CountingGame& game_;
  GameInput seen_, unseen_;
};

TEST_F(Runner, NothingPassesBeforeTheStart) {
  frames(30, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::idle);
  EXPECT_EQ(game_.steps, 0);
}

TEST_F(Runner, TicksFollowTime) {
  runner_.start(empty_field(0.2), {});
  frames(300, seen_);
  EXPECT_NEAR(game_.steps, 10 * kGameTicksPerSecond, 1);
  EXPECT_EQ(game_.poses, game_.steps);
  EXPECT_EQ(runner_.ticks(), game_.steps);
  // Uneven frames give as many.
  const int before = game_.steps;
  for (int i = 0; i < 1000; ++i) runner_.advance(i % 2 ? 0.0007 : 0.0193, seen_);
  EXPECT_NEAR(game_.steps - before, 10 * kGameTicksPerSecond, 1);
}

TEST_F(Runner, OddTimesDoNoHarm) {
  runner_.start(empty_field(0.2), {});
  for (const double seconds :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()})
    runner_.advance(seconds, seen_);
  EXPECT_EQ(game_.steps, 0);
  runner_.advance(1e9, seen_);
  EXPECT_NEAR(game_.steps, kGameTicksPerSecond / 4, 1);
}

TEST_F(Runner, OneBadFrameIsPlayedThroughWithTheLastPose) {
  runner_.start(empty_field(0.2), {});
  frames(30, seen_);
  frames(6, unseen_);
  EXPECT_EQ(runner_.phase(), GamePhase::playing);
  frames(30, seen_);
  EXPECT_NEAR(game_.steps, 66 * kGameTicksPerSecond / 30, 1);
  EXPECT_EQ(game_.poses, game_.steps);
}

TEST_F(Runner, LostTrackingStopsItAndACountDownComesBefore) {
  runner_.start(empty_field(0.2), {});
  frames(30, seen_);
  frames(30, unseen_);
  EXPECT_EQ(runner_.phase(), GamePhase::lost);
  const int stopped = game_.steps;
  EXPECT_LE(stopped, static_cast<int>(std::ceil((1 + kGameGrace_s) * kGameTicksPerSecond)));
  frames(10, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::resuming);
  EXPECT_GT(runner_.resumes_in_s(), 2.0);
  // Lost again during the count-down: it begins anew.
  frames(30, unseen_);
  EXPECT_EQ(runner_.phase(), GamePhase::lost);
  EXPECT_EQ(game_.steps, stopped);
  frames(89, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::resuming);
  EXPECT_EQ(game_.steps, stopped);
  frames(5, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::playing);
  EXPECT_GT(game_.steps, stopped);
  int count_downs = 0, resumes = 0;
  for (const GameSound& sound : runner_.take_sounds()) {
    count_downs += sound.name == "countdown" ? 1 : 0;
    resumes += sound.name == "resume" ? 1 : 0;
  }
  EXPECT_GE(count_downs, 3);
  EXPECT_EQ(resumes, 1);
  EXPECT_TRUE(runner_.take_sounds().empty());
}

TEST_F(Runner, PauseHoldsUntilItIsTakenBack) {
  runner_.start(empty_field(0.2), {});
  frames(30, seen_);
  runner_.toggle_pause();
  const int paused = game_.steps;
  frames(300, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::paused);
  EXPECT_EQ(game_.steps, paused);
  runner_.toggle_pause();
  EXPECT_EQ(runner_.phase(), GamePhase::resuming);
  frames(100, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::playing);
  EXPECT_GT(game_.steps, paused);
}

TEST_F(Runner, TheEndIsTheEndUntilTheNextStart) {
  runner_.start(empty_field(0.2), {});
  game_.ends_at = 50;
  frames(60, seen_);
  EXPECT_EQ(runner_.phase(), GamePhase::over);
  EXPECT_EQ(game_.steps, 50);
  runner_.toggle_pause();
  EXPECT_EQ(runner_.phase(), GamePhase::over);
  runner_.start(empty_field(0.2), {});
  EXPECT_EQ(runner_.phase(), GamePhase::playing);
  EXPECT_EQ(runner_.ticks(), 0);
}

TEST_F(Runner, TheScriptPlaysWithThePose) {
  runner_.set_scripted(true);
  runner_.start(empty_field(0.2), {});
  frames(30, seen_);
  EXPECT_GT(game_.steps, 100);
  EXPECT_EQ(game_.scripted_steps, game_.steps);
  EXPECT_EQ(game_.poses, game_.steps);
}

TEST_F(Runner, TheFieldIsHandedOn) {
  runner_.change_field(empty_field(0.5));
  EXPECT_EQ(game_.radius_m, 0);  // nothing runs
  runner_.start(empty_field(0.2), {});
  runner_.change_field(empty_field(0.5));
  EXPECT_EQ(game_.radius_m, 0.5);
}

TEST(PlayingField, WhatLengthsBecome) {
  PlayingField first = empty_field(0.2), grown = empty_field(0.3), scaled = empty_field(0.5), other = empty_field(0.7);
  scaled.scale = 2.5;
  other.number = 1;
  EXPECT_EQ(length_factor(first, grown), 1) << "more table";
  EXPECT_EQ(length_factor(first, scaled), 2.5) << "the same table in other metres";
  EXPECT_NEAR(length_factor(scaled, first), 0.4, 1e-15);
  EXPECT_NEAR(length_factor(scaled, other), 1.4, 1e-15) << "another table, in proportion";
  other.radius_m = 0;
  EXPECT_EQ(length_factor(first, other), 1);
}

TEST(PlayingField, InsideAndNearest) {
  const PlayingField field = empty_field(0.2);
  EXPECT_TRUE(inside_outline(field, {0, 0}));
  EXPECT_TRUE(inside_outline(field, {0.19, -0.19}));
  EXPECT_FALSE(inside_outline(field, {0.21, 0}));
  EXPECT_FALSE(inside_outline({}, {0, 0}));
  EXPECT_NEAR((nearest_on_outline(field, {0.5, 0.1}) - Eigen::Vector2d(0.2, 0.1)).norm(), 0, 1e-12);
  EXPECT_NEAR((nearest_on_outline(field, {0.5, 0.9}) - Eigen::Vector2d(0.2, 0.2)).norm(), 0, 1e-12);
  EXPECT_NEAR((nearest_on_outline(field, {0.15, 0.0}) - Eigen::Vector2d(0.2, 0.0)).norm(), 0, 1e-12);
}

TEST(PlayingField, TheCrossHairsAreWhereARayMeetsThePlane) {
  Eigen::Vector2d at;
  ASSERT_TRUE(meets_plane({0.1, 0.2, 0.5}, {0.1, 0, -1}, &at));
  EXPECT_NEAR((at - Eigen::Vector2d(0.15, 0.2)).norm(), 0, 1e-12);
  EXPECT_FALSE(meets_plane({0, 0, 0.5}, {0, 0, 1}, &at));
  EXPECT_FALSE(meets_plane({0, 0, 0.5}, {1, 0, 0}, &at));
}

}  // namespace
}  // namespace parallax
