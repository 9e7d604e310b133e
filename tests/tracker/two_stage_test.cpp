#include "tracker/two_stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tests/tracker/desk_map.h"
#include "tracker/tracking_quality.h"

namespace parallax {
namespace {

using test::centre_distance;
using test::desk_map;
using test::DeskMap;
using test::turn_between;

RigidTransform perturbed(const RigidTransform& pose, double metres, double radians, unsigned k) {
  const double a = 1.3 * k;
  Vector6d mu;
  mu << metres * std::cos(a), metres * std::sin(a), 0.3 * metres, radians * std::sin(a), radians * std::cos(a),
      0.2 * radians;
  return RigidTransform::exp(mu) * pose;
}

TEST(TwoStage, RecoversThePoseFromAPerturbedPrior) {
  DeskMap& d = desk_map();
  ASSERT_TRUE(check_consistency(d.map, d.views.camera()).empty());
  const TrackerOptions options;
  TwoStageTracker tracker(d.views.camera(), options);
  for (int view : {DeskMap::between, DeskMap::nearer}) {
    const RigidTransform truth = d.views.camera_from_world(view);
    for (unsigned k = 0; k < 5; ++k) {
      TwoStageRequest request;
      request.prior = perturbed(truth, 0.02, 0.025, k);  // some ten pixels
      TwoStageResult result;
      tracker.track(*d.snapshot, *d.views.images(view), request, &result);
      ASSERT_TRUE(result.ok);
      EXPECT_TRUE(result.coarse_used);
      EXPECT_EQ(assess_quality(result, options), TrackingQuality::good);
      EXPECT_LT(centre_distance(result.camera_from_world, truth), 0.0015) << "view " << view << " prior " << k;
      EXPECT_LT(turn_between(result.camera_from_world, truth), 0.0025);
    }
  }
}

TEST(TwoStage, WithoutTheCoarseStageASmallErrorIsMadeGood) {
  DeskMap& d = desk_map();
  TwoStageTracker tracker(d.views.camera(), TrackerOptions());
  const RigidTransform truth = d.views.camera_from_world(DeskMap::between);
  TwoStageRequest request;
  request.prior = perturbed(truth, 0.006, 0.006, 2);
  request.coarse = false;
  TwoStageResult result;
  tracker.track(*d.snapshot, *d.views.images(DeskMap::between), request, &result);
  ASSERT_TRUE(result.ok);
  EXPECT_FALSE(result.coarse_used);
  EXPECT_LT(centre_distance(result.camera_from_world, truth), 0.0015);
  EXPECT_LT(turn_between(result.camera_from_world, truth), 0.0025);
}

TEST(TwoStage, WhatItReportsAddsUp) {
  DeskMap& d = desk_map();
  TrackerOptions options;
  options.fine_points = 150;
  TwoStageTracker tracker(d.views.camera(), options);
  const RigidTransform truth = d.views.camera_from_world(DeskMap::between);
  TwoStageRequest request;
  request.prior = perturbed(truth, 0.01, 0.01, 1);
  TwoStageResult result;
  tracker.track(*d.snapshot, *d.views.images(DeskMap::between), request, &result);
  int attempted = 0, found = 0;
  for (std::size_t l = 0; l < kPyramidLevels; ++l) {
    EXPECT_LE(result.found[l], result.attempted[l]);
    attempted += result.attempted[l];
    found += result.found[l];
  }
  EXPECT_LE(attempted, options.fine_points);
  EXPECT_GT(attempted, 100);
  EXPECT_EQ(static_cast<int>(result.matches.size()), found);
  EXPECT_EQ(static_cast<int>(result.missed.size()), attempted - found);
  std::set<int> rows;
  int inliers = 0;
  for (const MatchedPoint& m : result.matches) {
    EXPECT_TRUE(rows.insert(m.row).second) << "searched once only";
    inliers += m.weight > 0 ? 1 : 0;
    if (m.weight <= 0) continue;
    Eigen::Vector2d px;
    ASSERT_TRUE(d.views.camera().project(truth * d.snapshot->position[static_cast<std::size_t>(m.row)], &px));
    EXPECT_LT((m.pixel - px).norm(), 3.5 * level_scale(m.level));
  }
  for (const Candidate& c : result.missed) EXPECT_TRUE(rows.insert(c.row).second);
  EXPECT_EQ(result.inliers, inliers);
  // The covariance belongs to the pose: positive, and of the size of what was achieved.
  EXPECT_GT(result.covariance.diagonal().minCoeff(), 0);
  EXPECT_LT(std::sqrt(result.covariance.topLeftCorner<3, 3>().trace()), 0.005);
}

TEST(TwoStage, TheSameInputGivesTheSameBits) {
  DeskMap& d = desk_map();
  TwoStageRequest request;
  request.prior = perturbed(d.views.camera_from_world(DeskMap::nearer), 0.01, 0.01, 3);
  TwoStageResult a, b;
  TwoStageTracker used(d.views.camera(), TrackerOptions()), fresh(d.views.camera(), TrackerOptions());
  used.track(*d.snapshot, *d.views.images(DeskMap::nearer), request, &a);
  fresh.track(*d.snapshot, *d.views.images(DeskMap::nearer), request, &b);
  EXPECT_EQ(a.camera_from_world.R, b.camera_from_world.R);
  EXPECT_EQ(a.camera_from_world.t, b.camera_from_world.t);
  EXPECT_EQ(a.matches.size(), b.matches.size());
}

TEST(TwoStage, NothingToSeeIsLost) {
  DeskMap& d = desk_map();
  const TrackerOptions options;
  TwoStageTracker tracker(d.views.camera(), options);
  TwoStageRequest request;
  request.prior = d.views.camera_from_world(DeskMap::between);
  TwoStageResult result;
  const auto blank = test::features_of(GreyImage(240, 320, static_cast<std::uint8_t>(80)));
  tracker.track(*d.snapshot, *blank, request, &result);
  EXPECT_EQ(assess_quality(result, options), TrackingQuality::lost);
  tracker.track(*d.snapshot, *d.views.images(DeskMap::elsewhere), request, &result);
  EXPECT_EQ(assess_quality(result, options), TrackingQuality::lost);
  tracker.track(TrackingSnapshot(), *d.views.images(DeskMap::between), request, &result);
  EXPECT_FALSE(result.ok);
  EXPECT_TRUE(result.matches.empty());
}

}  // namespace
}  // namespace parallax
