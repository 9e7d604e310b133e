#include "render/synthetic_path.h"

#include <gtest/gtest.h>

#include <cmath>

namespace parallax {
namespace {

// Between frames (and within exposures) a pose must not move faster than this.
void expect_continuous(const SyntheticMotion& motion, int frames, double max_speed, double max_turn) {
  for (int i = 1; i < frames; ++i) {
    if (motion.label(i).cut) continue;
    const RigidTransform a = motion.world_from_camera(i - 1, 0), b = motion.world_from_camera(i, 0);
    const double factor = motion.label(i).shaking || motion.label(i - 1).shaking ? 8 : 1;
    ASSERT_LT((b.t - a.t).norm() * kSyntheticFps, max_speed * factor) << i;
    ASSERT_LT((a.inverse() * b).angle() * kSyntheticFps, max_turn * factor) << i;
    // The same moment from both frames' side, and smooth velocity: central and one-sided differences agree.
    const double half = 0.5 / kSyntheticFps;
    const RigidTransform end = motion.world_from_camera(i - 1, half), start = motion.world_from_camera(i, -half);
    ASSERT_LT((end.t - start.t).norm(), 1e-9) << i;
    ASSERT_LT((end.inverse() * start).angle(), 1e-7) << i;
    const double h = 1e-3;
    const Eigen::Vector3d before = (end.t - motion.world_from_camera(i - 1, half - h).t) / h;
    const Eigen::Vector3d after = (motion.world_from_camera(i, -half + h).t - start.t) / h;
    ASSERT_LT((after - before).norm(), 0.08 * factor) << i;  // m/s within 2 ms
  }
}

TEST(SyntheticPath, MotionIsContinuousApartFromLabelledCuts) {
  expect_continuous(desk_motion(1), 3000, 1.0, 1.5);
  expect_continuous(desk_motion(77), 1000, 1.0, 1.5);
  expect_continuous(shakes_motion(1), 1200, 1.0, 1.5);
  expect_continuous(walls_motion(600), 600, 1.0, 1.0);
  expect_continuous(room_motion(1), 5000, 0.8, 1.0);
  expect_continuous(rotation_motion(1), 600, 1e-9, 1.5);
}

TEST(SyntheticPath, CutsAreRealJumps) {
  const SyntheticMotion motion = shakes_motion(1);
  int cuts = 0;
  for (int i = 1; i < 900; ++i) {
    if (!motion.label(i).cut) continue;
    ++cuts;
    EXPECT_GT((motion.world_from_camera(i, 0).t - motion.world_from_camera(i - 1, 0).t).norm(), 0.03) << i;
  }
  EXPECT_EQ(cuts, 3);
}

TEST(SyntheticPath, ShakesHoldsAllItsTrials) {
  const SyntheticMotion motion = shakes_motion(1);
  int covered = 0, shaking = 0, unseen = 0, light = 0;
  for (int i = 0; i < 900; ++i) {
    const FrameLabel l = motion.label(i);
    covered += l.covered, shaking += l.shaking, unseen += l.unseen, light += l.light;
    EXPECT_EQ(l.covered, motion.cover(i) > 0);
  }
  EXPECT_GT(covered, 60);
  EXPECT_GT(shaking, 60);
  EXPECT_GT(unseen, 40);
  EXPECT_EQ(light, 3);
  EXPECT_EQ(motion.label(2000), FrameLabel{});
}

TEST(SyntheticPath, DeskBeginsStillThenSlidesTenCentimetres) {
  const SyntheticMotion motion = desk_motion(1);
  const Eigen::Vector3d start = motion.world_from_camera(0, 0).t;
  EXPECT_LT((motion.world_from_camera(29, 0).t - start).norm(), 0.005);
  const Eigen::Vector3d slid = motion.world_from_camera(75, 0).t - start;
  EXPECT_NEAR(slid.x(), 0.10, 0.005);
  EXPECT_LT(slid.tail<2>().norm(), 0.005);
  // Sideways for the camera, hardly turning.
  EXPECT_LT((motion.world_from_camera(0, 0).inverse() * motion.world_from_camera(75, 0)).angle(), 0.02);
}

TEST(SyntheticPath, TheDeskCameraStaysAboveTheThingsOnTheTable) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
    const SyntheticMotion motion = desk_motion(seed);
    for (int i = 0; i < 20000; i += 5) {
      const Eigen::Vector3d p = motion.world_from_camera(i, 0).t;
      ASSERT_GT(p.z(), 0.17) << seed << " " << i;
      ASSERT_LT(p.y(), 0.12) << seed << " " << i;
      ASSERT_LT(std::abs(p.x()), 0.95) << seed << " " << i;
    }
  }
}

TEST(SyntheticPath, RotationNeverMoves) {
  const SyntheticMotion motion = rotation_motion(3);
  double turned = 0;
  for (int i = 0; i < 300; ++i) {
    EXPECT_EQ(motion.world_from_camera(i, 0.001).t, motion.world_from_camera(0, 0).t);
    turned = std::max(turned, (motion.world_from_camera(0, 0).inverse() * motion.world_from_camera(i, 0)).angle());
  }
  EXPECT_GT(turned, 0.25);
}

TEST(SyntheticPath, LookAtLooksThere) {
  const RigidTransform pose = look_at({1, 2, 3}, {0, 0, 0}, 0.3);
  const Eigen::Vector3d origin = pose.inverse() * Eigen::Vector3d(0, 0, 0);
  EXPECT_NEAR(origin.head<2>().norm(), 0, 1e-12);
  EXPECT_NEAR(origin.z(), std::sqrt(14.0), 1e-12);
  EXPECT_NEAR(pose.R.determinant(), 1, 1e-12);
  // Without roll, what is above in the world is above in the picture (y points down).
  EXPECT_LT((look_at({1, 2, 3}, {0, 0, 0}).inverse() * Eigen::Vector3d(0, 0, 0.1)).y(), 0);
}

}  // namespace
}  // namespace parallax
