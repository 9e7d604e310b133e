#include "tracker/stereo_odometry.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "render/synthetic_stereo_source.h"

namespace parallax {
namespace {

constexpr int kPairs = 26, kFirst = 100;

// A stretch of the synthetic building, drawn once.
struct Stretch {
  std::unique_ptr<SyntheticStereoSource> source =
      open_synthetic_stereo_source("synthetic:building?size=320x240&blur=0&noise=1");
  StereoCamera camera;
  std::vector<StereoFrame> frames;
  std::vector<RigidTransform> world_from_camera;

  Stretch() {
    const StereoCalibration rig = *source->calibration();
    camera = {rig.left.width(), rig.left.height(), rig.left.focal_px(), rig.left.centre_px(), rig.baseline_m()};
    for (int i = 0; i < kPairs; ++i) {
      frames.push_back(source->frame(kFirst + i));
      world_from_camera.push_back(source->world_from_camera(kFirst + i));
    }
  }
  const StereoFrame& frame(int i) const { return frames[static_cast<std::size_t>(i)]; }
  RigidTransform truth(int from, int to) const {
    return world_from_camera[static_cast<std::size_t>(from)].inverse() *
           world_from_camera[static_cast<std::size_t>(to)];
  }
};

Stretch& stretch() {
  static Stretch s;
  return s;
}

StereoTrackerOptions small_options() {
  StereoTrackerOptions options;
  options.features = 120;
  options.min_distance_px = 10;
  return options;
}

StereoFrameResult step(StereoOdometry* odometry, int i) {
  const StereoFrame& pair = stretch().frame(i);
  return odometry->process(i, pair.left.time, pair.left.grey, pair.right.grey);
}

StereoFrameResult step_with(StereoOdometry* odometry, int i, const GreyImage& left, const GreyImage& right) {
  return odometry->process(i, stretch().frame(i).left.time, left, right);
}

TEST(StereoOdometry, FollowsTheTruth) {
  const Stretch& s = stretch();
  StereoOdometry odometry(s.camera, small_options());
  std::vector<int> keyframes;  // their frames
  RigidTransform start_from_reference;
  std::vector<double> disparity_errors;
  double nees = 0;
  int compared = 0;
  for (int i = 0; i < kPairs; ++i) {
    const StereoFrameResult result = step(&odometry, i);
    ASSERT_EQ(result.state, i == 0 ? StereoState::started : StereoState::tracked) << i << ' ' << result.reason;
    EXPECT_TRUE(result.reason.empty());
    EXPECT_EQ(result.frame, i);
    if (i > 0) {
      EXPECT_GE(result.inliers, 50);
      EXPECT_LE(result.inliers, result.tracks);
      EXPECT_LE(result.right_matches, result.tracks);
      EXPECT_GT(result.right_matches, result.tracks / 2);
    }
    if (result.keyframe) {
      const StereoKeyframe& k = *result.keyframe;
      EXPECT_EQ(k.index, static_cast<int>(keyframes.size()));
      EXPECT_EQ(result.reference, k.index);
      EXPECT_FALSE(k.after_failure);
      EXPECT_TRUE(result.reference_from_camera.t.isZero(0));
      if (k.index > 0) {
        const RigidTransform truth = s.truth(keyframes.back(), i);
        const Vector6d error = (k.previous_from_this * truth.inverse()).log();
        EXPECT_LT(error.head<3>().norm(), 0.01) << k.index;
        EXPECT_LT(error.tail<3>().norm(), 0.004) << k.index;
        EXPECT_GE(truth.t.norm() + truth.angle(), 0.1);
        EXPECT_GT(k.covariance.ldlt().vectorD().minCoeff(), 0);
        nees += error.dot(k.covariance.ldlt().solve(error));
        ++compared;
      }
      start_from_reference = start_from_reference * k.previous_from_this;
      keyframes.push_back(i);
      const cv::Mat1f depth = stretch().source->depth(kFirst + i);
      for (const StereoMeasurement& m : k.measurements) {
        if (!std::isfinite(m.pixel.y())) continue;
        const float z = depth(static_cast<int>(std::lround(m.pixel.z())), static_cast<int>(std::lround(m.pixel.x())));
        if (z > 0) disparity_errors.push_back(std::abs(m.pixel.x() - m.pixel.y() - s.camera.disparity_px(z)));
      }
    } else {
      EXPECT_LT(result.reference_from_camera.t.norm(), small_options().keyframe_distance_m);
    }
    const RigidTransform now = start_from_reference * result.reference_from_camera;
    EXPECT_LT((now.t - s.truth(0, i).t).norm(), 0.02) << i;
  }
  EXPECT_GE(keyframes.size(), 3u);
  ASSERT_GT(disparity_errors.size(), 200u);
  std::nth_element(disparity_errors.begin(),
                   disparity_errors.begin() + static_cast<std::ptrdiff_t>(disparity_errors.size() / 2),
                   disparity_errors.end());
  EXPECT_LT(disparity_errors[disparity_errors.size() / 2], 0.1);
  RecordProperty("nees", std::to_string(nees / compared));
  EXPECT_LT(nees / compared, 20);  // a handful: the size of the errors, no more
}

TEST(StereoOdometry, BeginsAnewBehindACoveredImage) {
  const Stretch& s = stretch();
  const GreyImage covered(s.frame(0).left.grey.size(), 12);
  StereoOdometry odometry(s.camera, small_options());
  RigidTransform before;
  int keyframes = 0;
  for (int i = 0; i < 14; ++i) {
    const bool blind = i == 8 || i == 9;
    const StereoFrameResult result = blind ? step_with(&odometry, i, covered, covered) : step(&odometry, i);
    if (i < 8) {
      ASSERT_NE(result.state, StereoState::failed);
      before = result.reference_from_camera;
    } else if (blind) {
      EXPECT_EQ(result.state, StereoState::failed);
      EXPECT_NE(result.reason.find("too little texture"), std::string::npos) << result.reason;
      EXPECT_FALSE(result.keyframe);
      EXPECT_TRUE(odometry.tracks().empty());
    } else if (i == 10) {
      EXPECT_EQ(result.state, StereoState::started);
      ASSERT_TRUE(result.keyframe);
      EXPECT_TRUE(result.keyframe->after_failure);
      EXPECT_EQ(result.keyframe->index, keyframes);
      // Zero motion since it was last known, and a covariance that says it is a guess.
      EXPECT_LT((result.keyframe->previous_from_this * before.inverse()).log().norm(), 1e-9);
      EXPECT_GE(result.keyframe->covariance.ldlt().vectorD().minCoeff(), 0.1);
    } else {
      EXPECT_EQ(result.state, StereoState::tracked) << i;
      if (result.keyframe) {
        EXPECT_FALSE(result.keyframe->after_failure);
      }
    }
    keyframes += static_cast<int>(result.keyframe.has_value());
  }
}

TEST(StereoOdometry, SaysWhyItDoesNotStart) {
  const Stretch& s = stretch();
  const GreyImage blank(s.frame(0).left.grey.size(), 128);
  StereoOdometry odometry(s.camera, small_options());
  StereoFrameResult result = step_with(&odometry, 0, blank, blank);
  EXPECT_EQ(result.state, StereoState::failed);
  EXPECT_NE(result.reason.find("too little texture: 0 corners"), std::string::npos) << result.reason;
  // The right camera is covered.
  result = step_with(&odometry, 1, s.frame(1).left.grey, blank);
  EXPECT_EQ(result.state, StereoState::failed);
  EXPECT_NE(result.reason.find("only 0 of "), std::string::npos) << result.reason;
  EXPECT_NE(result.reason.find("right image"), std::string::npos) << result.reason;
  // And then it does, with nothing behind it that had failed.
  result = step(&odometry, 2);
  EXPECT_EQ(result.state, StereoState::started);
  ASSERT_TRUE(result.keyframe);
  EXPECT_FALSE(result.keyframe->after_failure);
  EXPECT_EQ(result.keyframe->index, 0);
  EXPECT_EQ(result.keyframe->frame, 2);
}

// While it tracks, the left camera alone carries it for a while.
TEST(StereoOdometry, RightCameraCoveredForAMoment) {
  const Stretch& s = stretch();
  const GreyImage covered(s.frame(0).left.grey.size(), 12);
  StereoOdometry odometry(s.camera, small_options());
  RigidTransform start_from_reference;
  for (int i = 0; i < 8; ++i) {
    const bool blind = i == 4 || i == 5;
    const StereoFrameResult result =
        blind ? step_with(&odometry, i, s.frame(i).left.grey, covered) : step(&odometry, i);
    ASSERT_NE(result.state, StereoState::failed) << result.reason;
    if (blind) {
      EXPECT_EQ(result.right_matches, 0);
    }
    if (result.keyframe) start_from_reference = start_from_reference * result.keyframe->previous_from_this;
    EXPECT_LT(((start_from_reference * result.reference_from_camera).t - s.truth(0, i).t).norm(), 0.02) << i;
  }
}

TEST(StereoOdometry, SameBitsTwice) {
  const Stretch& s = stretch();
  StereoOdometry one(s.camera, small_options()), two(s.camera, small_options());
  for (int i = 0; i < 8; ++i) {
    const StereoFrameResult a = step(&one, i), b = step(&two, i);
    EXPECT_EQ(a.reference_from_camera.R, b.reference_from_camera.R);
    EXPECT_EQ(a.reference_from_camera.t, b.reference_from_camera.t);
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.tracks, b.tracks);
    EXPECT_EQ(a.hypotheses, b.hypotheses);
  }
}

TEST(StereoOdometry, TakesWhatTheWindowSays) {
  const Stretch& s = stretch();
  StereoOdometry odometry(s.camera, small_options());
  const StereoFrameResult first = step(&odometry, 0);
  ASSERT_TRUE(first.keyframe);
  const std::size_t tracks = odometry.tracks().size();
  StereoWindowUpdate update;
  update.keyframe = 0;
  for (const StereoMeasurement& m : first.keyframe->measurements)
    update.points.push_back({m.track, m.point, 3, m.track % 4 == 0});
  const auto dropped = static_cast<std::size_t>(
      std::count_if(update.points.begin(), update.points.end(), [](const auto& p) { return p.outlier; }));
  ASSERT_GT(dropped, 5u);
  odometry.take(update);
  EXPECT_EQ(odometry.tracks().size(), tracks - dropped);
  // Of a keyframe that is not known: nothing.
  update.keyframe = 7;
  for (auto& point : update.points) point.outlier = true;
  odometry.take(update);
  EXPECT_EQ(odometry.tracks().size(), tracks - dropped);
  EXPECT_EQ(step(&odometry, 1).state, StereoState::tracked);
}

TEST(StereoOdometry, OptionsThatMakeNoSenseAreRefused) {
  const StereoCamera camera{320, 240, {200, 200}, {160, 120}, 0.1};
  StereoTrackerOptions none, far, unsure;
  none.features = 0;
  far.keyframe_distance_m = -1;
  unsure.sigma_px = 0;
  for (const StereoTrackerOptions& options : {none, far, unsure})
    EXPECT_THROW(StereoOdometry(camera, options), InputError);
}

}  // namespace
}  // namespace parallax
