#include "sessions/encounter_vote.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "tests/sessions/simulated_sessions.h"

namespace parallax {
namespace {

using testing::simulate_encounter;
using testing::simulate_session;
using testing::SimulatedSession;

struct TwoSessions : ::testing::Test {
  SimulatedSession first = simulate_session(1, 150, 0, 1, 11), second = simulate_session(2, 150, 5, 1, 12);
  std::mt19937_64 rng{5};
  EncounterVote vote;
  std::int64_t next = 1;

  void SetUp() override {
    for (const SimulatedSession* s : {&first, &second})
      for (const StereoConstraint& c : s->constraints) vote.extend(s->number, c);
  }
  // The second session's keyframe i is where the first was 20 keyframes later.
  Encounter right(int query) { return simulate_encounter(next++, first, query + 20, second, query, 1, &rng); }
  // The same corridor, one door further: wrong by 2 m, in the same way at every keyframe.
  Encounter alias(int query) {
    Encounter out = simulate_encounter(next++, first, query + 28, second, query, 1, &rng);
    const RigidTransform shift(Eigen::Matrix3d::Identity(), {2, 0, 0});
    out.found_from_query = first.global_from_camera[static_cast<std::size_t>(query + 28)].inverse() * shift *
                           second.global_from_camera[static_cast<std::size_t>(query)];
    return out;
  }
};

TEST_F(TwoSessions, SixThatAgreeAreTaken) {
  for (int i = 3; i < 8; ++i) EXPECT_TRUE(vote.add(right(i)).activate.empty());
  const auto verdict = vote.add(right(9));
  EXPECT_EQ(verdict.activate, (std::vector<std::int64_t>{1, 2, 3, 4, 5, 6}));
  EXPECT_TRUE(verdict.refuse.empty());
  EXPECT_EQ(vote.add(right(12)).activate, (std::vector<std::int64_t>{7}));
}

// Alike here and there, not all along: pictures that hang on several walls.
TEST_F(TwoSessions, ThinlySpreadTheyDoNotCount) {
  for (int i = 3; i < 24; i += 3) EXPECT_TRUE(vote.add(right(i)).activate.empty());
}

TEST_F(TwoSessions, AKeyframeThatRecognisesTwoPlacesHasNoVoice) {
  for (int i = 3; i < 20; ++i) {
    EXPECT_TRUE(vote.add(right(i)).activate.empty());
    EXPECT_TRUE(vote.add(alias(i)).activate.empty());
  }
  for (int i = 20; i < 25; ++i) EXPECT_TRUE(vote.add(right(i)).activate.empty());
  EXPECT_FALSE(vote.add(right(25)).activate.empty());
}

TEST_F(TwoSessions, OneKeyframeIsOneVoiceHoweverManyItFinds) {
  for (int k = 0; k < 8; ++k) {
    Encounter e = simulate_encounter(next++, first, 23 + k, second, 3, 1, &rng);
    EXPECT_TRUE(vote.add(e).activate.empty());
  }
}

TEST_F(TwoSessions, WhatContradictsIsLeftOut) {
  for (int i = 3; i < 11; ++i) vote.add(right(i));
  for (int i = 4; i < 12; ++i) {
    const auto verdict = vote.add(alias(i));
    EXPECT_TRUE(verdict.activate.empty()) << i;
    EXPECT_TRUE(verdict.refuse.empty()) << i;
  }
  EXPECT_EQ(vote.add(right(12)).activate.size(), 1u);
}

// Wrong ones came first, and agreed: the right ones take over when they are twice as many.
TEST_F(TwoSessions, ALargerNumberOutvotesASmaller) {
  for (int i = 3; i < 9; ++i) vote.add(alias(i));
  std::vector<std::int64_t> wrong{1, 2, 3, 4, 5, 6}, refused;
  std::size_t taken = 0;
  int needed = 0;
  while (refused.empty() && needed < 40) {
    const auto verdict = vote.add(right(9 + needed));
    ++needed;
    refused = verdict.refuse;
    taken = verdict.activate.size();
  }
  std::sort(refused.begin(), refused.end());
  EXPECT_EQ(refused, wrong);
  EXPECT_EQ(needed, 12);
  EXPECT_EQ(taken, 12u);
}

TEST_F(TwoSessions, FarApartTheyDoNotConfirmEachOther) {
  EncounterVoteOptions options;
  options.between_sessions = 2;
  options.least_density = 0;
  EncounterVote two(options);
  for (const SimulatedSession* s : {&first, &second})
    for (const StereoConstraint& c : s->constraints) two.extend(s->number, c);
  two.add(right(3));
  EXPECT_TRUE(two.add(right(50)).activate.empty());
  EXPECT_FALSE(two.add(right(52)).activate.empty());
}

TEST_F(TwoSessions, RightOnesPassTheGateWrongOnesDoNot) {
  int within = 0, all = 0, wrong_within = 0;
  for (int i = 3; i < 100; i += 3)
    for (int step = 1; step <= 8; step += 3) {
      const Encounter a = right(i), b = right(i + step), c = alias(i + step);
      ++all;
      within += vote.disagreement(a, b) < EncounterVoteOptions().gate;
      wrong_within += vote.disagreement(a, c) < EncounterVoteOptions().gate;
    }
  EXPECT_GE(within, all - 1);
  EXPECT_EQ(wrong_within, 0);
}

TEST_F(TwoSessions, NothingIsConfirmedAcrossALoss) {
  EncounterVote other;
  SimulatedSession broken = second;
  broken.constraints[4].after_failure = true;
  for (const StereoConstraint& c : first.constraints) other.extend(1, c);
  for (const StereoConstraint& c : broken.constraints) other.extend(2, c);
  const Encounter before = right(3), after = right(6), later = right(7);
  EXPECT_TRUE(std::isinf(other.disagreement(before, after)));
  EXPECT_LT(other.disagreement(after, later), EncounterVoteOptions().gate);
}

// What was recognised before the motion was lost is no rival of what is recognised after it.
TEST_F(TwoSessions, AfterALossTheVoteBeginsAnew) {
  EncounterVote other;
  SimulatedSession broken = second;
  broken.constraints[39].after_failure = true;
  broken.constraints[39].from_from_to = {};
  for (const StereoConstraint& c : first.constraints) other.extend(1, c);
  for (const StereoConstraint& c : broken.constraints) other.extend(2, c);
  for (int i = 10; i < 40; ++i) other.add(right(i));
  for (int i = 40; i < 45; ++i) {
    const auto verdict = other.add(right(i));
    EXPECT_TRUE(verdict.activate.empty() && verdict.refuse.empty()) << i;
  }
  const auto verdict = other.add(right(45));
  EXPECT_EQ(verdict.activate, (std::vector<std::int64_t>{31, 32, 33, 34, 35, 36}));
  EXPECT_TRUE(verdict.refuse.empty());
  EXPECT_EQ(other.add(right(46)).activate, (std::vector<std::int64_t>{37}));
}

// The first session goes by a place before and after a loss; which of the two its keyframes show cannot be compared.
TEST_F(TwoSessions, TheSamePlaceOnBothSidesOfALossIsNotTwoPlaces) {
  EncounterVote other;
  SimulatedSession broken = first;
  broken.constraints[59].after_failure = true;
  for (const StereoConstraint& c : broken.constraints) other.extend(1, c);
  for (const StereoConstraint& c : second.constraints) other.extend(2, c);
  std::size_t active = 0;
  for (int i = 10; i < 20; ++i) {
    Encounter again = simulate_encounter(next++, first, 30 + i + 40, second, i, 1, &rng);
    active += other.add(right(i)).activate.size();
    active += other.add(again).activate.size();
  }
  EXPECT_EQ(active, 20u);
}

TEST(EncounterVote, WithinASessionThreeAreEnoughAndOdometryHasASay) {
  const SimulatedSession s = simulate_session(1, 300, 0, 1, 3);  // 75 m: once round and a third
  EncounterVote vote;
  for (const StereoConstraint& c : s.constraints) vote.extend(1, c);
  std::mt19937_64 rng(1);
  EXPECT_TRUE(vote.add(simulate_encounter(1, s, 10, s, 234, 1, &rng)).activate.empty());
  EXPECT_TRUE(vote.add(simulate_encounter(2, s, 11, s, 235, 1, &rng)).activate.empty());
  EXPECT_EQ(vote.add(simulate_encounter(3, s, 12, s, 236, 1, &rng)).activate, (std::vector<std::int64_t>{1, 2, 3}));
  // The same wall nine metres on: twelve metres of way cannot have drifted so far.
  for (int i = 0; i < 8; ++i) {
    Encounter alias = simulate_encounter(10 + i, s, 10 + i, s, 46 + i, 1, &rng);
    alias.found_from_query = RigidTransform(Eigen::Matrix3d::Identity(), {0, 0, 0.1});
    const auto verdict = vote.add(alias);
    EXPECT_TRUE(verdict.activate.empty());
    EXPECT_EQ(verdict.refuse, (std::vector<std::int64_t>{10 + i}));
  }
}

TEST(EncounterVote, RestoredAndForgotten) {
  const SimulatedSession a = simulate_session(1, 60, 0, 1, 3), b = simulate_session(2, 60, 0, 1, 4);
  std::mt19937_64 rng(1);
  EncounterVote vote;
  for (const SimulatedSession* s : {&a, &b})
    for (const StereoConstraint& c : s->constraints) vote.extend(s->number, c);
  Encounter kept = simulate_encounter(1, a, 10, b, 10, 1, &rng);
  kept.state = EncounterState::active;
  vote.restore(kept);
  EXPECT_EQ(vote.add(simulate_encounter(2, a, 12, b, 12, 1, &rng)).activate, (std::vector<std::int64_t>{2}));
  kept.state = EncounterState::off;  // by the user: it has no voice
  vote.restore(kept);
  vote.forget_session(2);
  EXPECT_FALSE(vote.knows({2, 0}));
  EXPECT_TRUE(vote.knows({1, 59}));
}

TEST(EncounterVote, OptionsOutOfRangeAreNamed) {
  EncounterVoteOptions options;
  options.reach_m = 0;
  try {
    EncounterVote vote(options);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("reach_m"), std::string::npos);
  }
}

}  // namespace
}  // namespace parallax
