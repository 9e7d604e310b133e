#include "map/shared_map.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <atomic>
#include <stdexcept>
#include <thread>

#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using test::fabricate_map;
using test::flat_camera;

void fill(SharedMap* shared, int points = 12) {
  shared->write([&](Map& m) { m = fabricate_map(points).map; });
}

TEST(SharedMap, SnapshotIsNeverNullAndChangesOnlyWhenPublished) {
  SharedMap shared;
  const auto empty = shared.snapshot();
  ASSERT_NE(empty, nullptr);
  EXPECT_TRUE(empty->empty());
  EXPECT_EQ(empty->version, 0U);
  fill(&shared);
  EXPECT_EQ(shared.snapshot(), empty);
  shared.publish();
  const auto full = shared.snapshot();
  EXPECT_EQ(full->version, 1U);
  EXPECT_EQ(full->size(), 12);
  shared.write([](Map& m) { m.clear(); });
  shared.publish();
  EXPECT_EQ(full->size(), 12) << "what the tracker holds stays as it was";
  EXPECT_EQ(full->version, 1U);
  EXPECT_EQ(shared.snapshot()->version, 2U);
  EXPECT_TRUE(shared.snapshot()->empty());
}

TEST(SharedMap, ReadAndWriteReturnWhatTheFunctionReturns) {
  SharedMap shared;
  fill(&shared);
  EXPECT_EQ(shared.read([](const Map& m) { return m.points.size(); }), 12);
  EXPECT_EQ(shared.write([](Map& m) {
    m.erase_point({0, 0});
    return m.points.size();
  }),
            11);
  EXPECT_THROW(shared.write([](Map&) { throw std::runtime_error("x"); }), std::runtime_error);
  EXPECT_EQ(shared.read([](const Map& m) { return m.points.size(); }), 11) << "the lock was given back";
}

TEST(SharedMap, WorldChangesAreCarriedByTheNextPublication) {
  SharedMap shared;
  fill(&shared);
  shared.publish();
  const auto first = shared.snapshot();
  const SimilarityTransform a(2.0, exp_so3({0.1, 0.2, 0.3}), {1, 2, 3}), b(0.5, exp_so3({-0.4, 0, 0.2}), {0, -1, 0});
  for (const SimilarityTransform& change : {a, b}) {
    shared.move_world(change);
  }
  EXPECT_EQ(shared.snapshot()->world_version, 0U);
  shared.publish();
  const auto second = shared.snapshot();
  EXPECT_EQ(second->world_version, 2U);
  EXPECT_EQ(second->map_version, first->map_version);
  // newest.world_from_first * known.world_from_first^-1 takes what was known to the present world.
  const SimilarityTransform change = second->world_from_first * first->world_from_first.inverse();
  for (int i = 0; i < first->size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    EXPECT_NEAR((change * first->position[row] - second->position[row]).norm(), 0, 1e-12);
  }
  const RigidTransform rebased = change.rebase(first->keyframes[1].camera_from_world);
  EXPECT_NEAR((rebased.R - second->keyframes[1].camera_from_world.R).norm(), 0, 1e-12);
  EXPECT_NEAR((rebased.t - second->keyframes[1].camera_from_world.t).norm(), 0, 1e-12);
}

TEST(SharedMap, ANewMapStartsANewWorld) {
  SharedMap shared;
  fill(&shared);
  shared.move_world(SimilarityTransform(3.0, Eigen::Matrix3d::Identity(), {0, 0, 1}));
  shared.publish();
  EXPECT_EQ(shared.snapshot()->world_from_first.s, 3.0);
  shared.replace_map({});
  shared.publish();
  const auto s = shared.snapshot();
  EXPECT_EQ(s->map_version, 1U);
  EXPECT_EQ(s->world_from_first.s, 1.0);
  EXPECT_EQ(s->world_from_first.t.norm(), 0);
  EXPECT_GE(s->world_version, 1U) << "versions never go back";
}

TEST(SharedMap, LockTimesAreKept) {
  SharedMap shared;
  fill(&shared);
  shared.publish();
  for (int i = 0; i < 5; ++i) shared.read([](const Map&) {});
  const LockTimes times = shared.lock_times();
  EXPECT_EQ(times.wait_ms.size(), 7U);
  EXPECT_EQ(times.hold_ms.size(), 7U);
  for (float t : times.wait_ms) EXPECT_GE(t, 0.0F);
  for (float t : times.hold_ms) EXPECT_GE(t, 0.0F);
  shared.snapshot();
  EXPECT_EQ(shared.snapshot_waits_ms().size(), 1U);
}

// One thread moves the world and publishes, as the mapper does; the other reads map and snapshots, as the tracker does.
TEST(SharedMap, TwoThreadsSeeWholeStatesOnly) {
  SharedMap shared;
  fill(&shared, 30);
  shared.publish();
  const auto start = shared.snapshot();
  constexpr int kRounds = 300;
  std::atomic<bool> done = false;
  std::jthread writer([&] {
    for (int i = 0; i < kRounds; ++i) {
      const SimilarityTransform change(i % 2 ? 1.1 : 1 / 1.1, exp_so3({0, 0.001 * i, 0}), {0.01, 0, 0});
      shared.move_world(change);
      shared.publish();
    }
    done = true;
  });
  std::uint64_t last_version = 0, last_world = 0;
  int looked = 0;
  while (!done || looked == 0) {
    const auto s = shared.snapshot();
    ASSERT_GE(s->version, last_version);
    ASSERT_GE(s->world_version, last_world);
    last_version = s->version;
    last_world = s->world_version;
    // Positions, poses and transform are those of one moment.
    const SimilarityTransform change = s->world_from_first * start->world_from_first.inverse();
    for (std::size_t i = 0; i < s->id.size(); i += 7)
      ASSERT_NEAR((change * start->position[i] - s->position[i]).norm(), 0, 1e-9);
    ASSERT_NEAR((change * start->keyframes[2].centre - s->keyframes[2].centre).norm(), 0, 1e-9);
    const auto faults = shared.read([](const Map& m) { return check_consistency(m, flat_camera()); });
    ASSERT_TRUE(faults.empty()) << faults.front();
    ++looked;
  }
  writer.join();
  EXPECT_EQ(shared.snapshot()->version, static_cast<std::uint64_t>(kRounds) + 1);
  EXPECT_EQ(shared.snapshot()->world_version, static_cast<std::uint64_t>(kRounds));
}

}  // namespace
}  // namespace parallax
