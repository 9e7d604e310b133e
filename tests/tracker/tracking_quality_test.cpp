#include "tracker/tracking_quality.h"

#include <gtest/gtest.h>

namespace parallax {
namespace {

const CameraModel& plain_camera() {
  static const CameraModel c(CameraModelKind::pinhole, 640, 480, {400, 400}, {320, 240});
  return c;
}

// A frame in which so many points of the fine levels, and of the coarse ones, were searched and found; all agree.
TwoStageResult result(int fine_tried, int fine_found, int coarse_tried = 0, int coarse_found = 0) {
  TwoStageResult r;
  r.ok = true;
  r.sigma = 1;
  r.attempted = {fine_tried, 0, coarse_tried, 0};
  r.found = {fine_found, 0, coarse_found, 0};
  r.inliers = fine_found + coarse_found;
  // Matches all over the image.
  for (int i = 0; i < r.inliers; ++i) {
    MatchedPoint m;
    m.row = i;
    m.pixel = Eigen::Vector2d((i * 97) % 640, (i * 61) % 480);
    m.weight = 1;
    r.matches.push_back(m);
  }
  return r;
}

TEST(TrackingQuality, FractionFoundDecides) {
  const TrackerOptions o;
  EXPECT_EQ(assess_quality(result(1000, 900), o), TrackingQuality::good);
  EXPECT_EQ(assess_quality(result(1000, 305), o), TrackingQuality::good);
  EXPECT_EQ(assess_quality(result(1000, 295), o), TrackingQuality::poor);
  EXPECT_EQ(assess_quality(result(1000, 135), o), TrackingQuality::poor);
  EXPECT_EQ(assess_quality(result(1000, 125), o), TrackingQuality::lost);
}

TEST(TrackingQuality, CoarsePointsCarryABlurredFrame) {
  const TrackerOptions o;
  EXPECT_EQ(assess_quality(result(900, 60, 50, 40), o), TrackingQuality::poor)
      << "motion blur takes the fine levels first";
  EXPECT_EQ(assess_quality(result(900, 60, 50, 4), o), TrackingQuality::lost);
  EXPECT_EQ(assess_quality(result(900, 60, 6, 6), o), TrackingQuality::lost) << "six attempts say nothing";
}

TEST(TrackingQuality, APoseThatItsOwnMatchesContradictIsNone) {
  const TrackerOptions o;
  TwoStageResult r = result(1000, 900);
  r.ok = false;
  EXPECT_EQ(assess_quality(r, o), TrackingQuality::lost);
  r = result(1000, 900);
  r.inliers = 440;  // less than half of what was found
  EXPECT_EQ(assess_quality(r, o), TrackingQuality::lost);
  r = result(1000, 500);
  r.inliers = 280;  // outliers were not found
  EXPECT_EQ(assess_quality(r, o), TrackingQuality::poor);
  r = result(1000, 900);
  r.sigma = o.max_sigma * 1.01;
  EXPECT_EQ(assess_quality(r, o), TrackingQuality::lost);
  EXPECT_EQ(assess_quality(result(o.min_inliers, o.min_inliers), o), TrackingQuality::good);
  EXPECT_EQ(assess_quality(result(o.min_inliers - 1, o.min_inliers - 1), o), TrackingQuality::lost);
  EXPECT_EQ(assess_quality(TwoStageResult(), o), TrackingQuality::lost);
}

TEST(TrackingQuality, RecoveryIsStricter) {
  const TrackerOptions o;
  EXPECT_TRUE(accept_recovery(result(400, 350), plain_camera(), o));
  EXPECT_FALSE(accept_recovery(result(1000, 150), plain_camera(), o)) << "tracked, but not enough to come back with";
  EXPECT_FALSE(accept_recovery(result(o.recovery_min_inliers - 1, o.recovery_min_inliers - 1), plain_camera(), o));
  TwoStageResult corner = result(400, 350);
  for (MatchedPoint& m : corner.matches) m.pixel = Eigen::Vector2d(20, 30);
  EXPECT_FALSE(accept_recovery(corner, plain_camera(), o)) << "one textured corner is no support";
  TwoStageResult outliers = result(400, 350);
  outliers.inliers = 100;
  for (std::size_t i = 100; i < outliers.matches.size(); ++i) outliers.matches[i].weight = 0;
  EXPECT_FALSE(accept_recovery(outliers, plain_camera(), o));
}

// A desk with the same keyboard and screen as the mapped one: two fifths are found, and do not quite agree.
TEST(TrackingQuality, FurnitureInCommonIsNoPlace) {
  const TrackerOptions o;
  TwoStageResult some = result(437, 176);
  EXPECT_TRUE(accept_recovery(some, plain_camera(), o));
  some.sigma = 2.5;
  EXPECT_FALSE(accept_recovery(some, plain_camera(), o));
  TwoStageResult most = result(437, 300);
  most.sigma = 2.5;
  EXPECT_TRUE(accept_recovery(most, plain_camera(), o)) << "a young map, off by more than its points admit";
}

// Much has been moved since: few of the points are there, but those that are agree, all over the image.
TEST(TrackingQuality, AChangedDeskIsComeBackToAndAnotherIsNot) {
  const TrackerOptions o;
  const auto sharp = [](TwoStageResult r) {
    r.sigma = 0.4;
    return r;
  };
  EXPECT_TRUE(accept_recovery(sharp(result(1000, 220)), plain_camera(), o));
  EXPECT_FALSE(accept_recovery(sharp(result(1000, 170)), plain_camera(), o)) << "too few of what should be seen";
  EXPECT_FALSE(accept_recovery(sharp(result(300, 90)), plain_camera(), o)) << "too few to say so";
  TwoStageResult contradicted = sharp(result(1000, 300));
  contradicted.inliers = 260;
  EXPECT_FALSE(accept_recovery(contradicted, plain_camera(), o)) << "things that two desks share";
  TwoStageResult loose = result(1000, 300);
  loose.sigma = 0.9;
  EXPECT_FALSE(accept_recovery(loose, plain_camera(), o));
  TwoStageResult keyboard = sharp(result(1000, 300));
  for (MatchedPoint& m : keyboard.matches) m.pixel = 0.45 * m.pixel + Eigen::Vector2d(170, 120);
  EXPECT_FALSE(accept_recovery(keyboard, plain_camera(), o)) << "one thing that was moved";
}

}  // namespace
}  // namespace parallax
