#include "tracker/relocaliser.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/tracker/desk_map.h"

namespace parallax {
namespace {

using test::centre_distance;
using test::desk_map;
using test::DeskMap;
using test::features_of;
using test::turn_between;

constexpr int kFrames = 6;  // tries, as while a camera stands still

// Every frame the camera could have been lost from: far to a side, turned away, below the table.
std::vector<RigidTransform> hints() {
  return {test::above_desk(0.6).inverse(), test::above_desk(0.0, 1.2).inverse(), RigidTransform()};
}

bool recover(const FrameImages& frame, const RigidTransform& hint, TwoStageResult* out) {
  DeskMap& d = desk_map();
  const TrackerOptions options;
  Relocaliser relocaliser(d.views.camera(), options);
  TwoStageTracker tracker(d.views.camera(), options);
  for (int i = 0; i < kFrames; ++i)
    if (relocaliser.recover(*d.snapshot, frame, hint, &tracker, out)) return true;
  return false;
}

TEST(Relocaliser, ComesBackNearAKeyframeFromAnywhere) {
  DeskMap& d = desk_map();
  for (int view : {DeskMap::first, DeskMap::third, DeskMap::between}) {
    for (const RigidTransform& hint : hints()) {
      TwoStageResult result;
      ASSERT_TRUE(recover(*d.views.images(view), hint, &result)) << "view " << view;
      const RigidTransform truth = d.views.camera_from_world(view);
      EXPECT_LT(centre_distance(result.camera_from_world, truth), 0.003) << "view " << view;
      EXPECT_LT(turn_between(result.camera_from_world, truth), 0.005);
      EXPECT_GE(result.inliers, TrackerOptions().recovery_min_inliers);
    }
  }
}

TEST(Relocaliser, TheLastPoseIsTriedFirst) {
  DeskMap& d = desk_map();
  const RigidTransform truth = d.views.camera_from_world(DeskMap::nearer);
  const TrackerOptions options;
  Relocaliser relocaliser(d.views.camera(), options);
  TwoStageTracker tracker(d.views.camera(), options);
  TwoStageResult result;
  ASSERT_TRUE(relocaliser.recover(*d.snapshot, *d.views.images(DeskMap::nearer), truth, &tracker, &result));
  EXPECT_LT(centre_distance(result.camera_from_world, truth), 0.003);
}

TEST(Relocaliser, NeverAcceptsAnImageOfSomethingElse) {
  DeskMap& d = desk_map();
  std::vector<std::shared_ptr<const FrameImages>> strangers = {
      d.views.images(DeskMap::elsewhere), features_of(GreyImage(240, 320, static_cast<std::uint8_t>(120)))};
  GreyImage noise(240, 320);
  cv::RNG rng(3);
  rng.fill(noise, cv::RNG::NORMAL, 100, 25);
  strangers.push_back(features_of(noise));
  for (const char* scene : {"repeat", "blank", "room"}) {
    test::RenderedViews other({test::above_desk(0.0), test::above_desk(0.1, 0.3)}, scene);
    for (int i = 0; i < other.size(); ++i) strangers.push_back(other.images(i));
  }
  // A hand over the lens: dark, with a rim of the desk left at the side.
  GreyImage covered = d.views.frame(DeskMap::between).grey.clone();
  covered(cv::Rect(0, 0, 290, 240)) = 25;
  strangers.push_back(features_of(covered));
  std::vector<RigidTransform> from = hints();
  from.push_back(d.views.camera_from_world(DeskMap::between));
  for (std::size_t i = 0; i < strangers.size(); ++i) {
    for (const RigidTransform& hint : from) {
      TwoStageResult result;
      const bool accepted = recover(*strangers[i], hint, &result);
      // The rim of the desk may be recognised, rightly.
      const bool right = centre_distance(result.camera_from_world, d.views.camera_from_world(DeskMap::between)) < 0.01;
      EXPECT_FALSE(accepted && !(right && i + 1 == strangers.size()))
          << "image " << i << ": " << result.inliers << " inliers";
    }
  }
}

TEST(Relocaliser, AnEmptyMapGivesNothing) {
  DeskMap& d = desk_map();
  const TrackerOptions options;
  Relocaliser relocaliser(d.views.camera(), options);
  TwoStageTracker tracker(d.views.camera(), options);
  TwoStageResult result;
  relocaliser.reset();
  EXPECT_FALSE(relocaliser.recover(TrackingSnapshot(), *d.views.images(0), RigidTransform(), &tracker, &result));
}

}  // namespace
}  // namespace parallax
