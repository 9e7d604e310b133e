#include "render/synthetic_building.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "render/synthetic_stereo_source.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::string walk_name(int walk, const std::string& keys = "") {
  return "synthetic:building?walk=" + (walk == kBuildingStairs ? "stairs" : std::to_string(walk)) + keys;
}

bool same_bytes(const cv::Mat1b& a, const cv::Mat1b& b) {
  for (int y = 0; y < a.rows; ++y)
    if (std::memcmp(a.ptr(y), b.ptr(y), static_cast<std::size_t>(a.cols)) != 0) return false;
  return a.size() == b.size();
}

// How far the left picture is from the right one where the depth says it is to be found, `shift` pixels beside it:
// median over textured pixels, grey levels.
double disparity_error(SyntheticStereoSource& source, int index, double shift) {
  const StereoFrame pair = source.frame(index);
  const cv::Mat1f depth = source.depth(index);
  const StereoCalibration rig = *source.calibration();
  cv::Mat1f gradient;
  cv::Sobel(pair.left.grey, gradient, CV_32F, 1, 0);
  std::vector<double> errors;
  for (int y = 8; y < depth.rows - 8; ++y)
    for (int x = 8; x < depth.cols - 8; ++x) {
      Vector3d ray;
      Vector2d right;
      if (std::abs(gradient(y, x)) < 40 || !rig.left.unproject(Vector2d(x, y), &ray)) continue;
      if (!rig.right.project(rig.right_from_left * Vector3d(ray * depth(y, x)), &right)) continue;
      const double at = right.x() + shift;
      const int x0 = static_cast<int>(std::floor(at));
      if (x0 < 0 || x0 + 1 >= depth.cols) continue;
      EXPECT_NEAR(right.y(), y, 1e-6) << "not rectified";
      const double f = at - x0, value = (1 - f) * pair.right.grey(y, x0) + f * pair.right.grey(y, x0 + 1);
      errors.push_back(std::abs(value / 1.015 - pair.left.grey(y, x)));
    }
  if (errors.size() < 500) return -1;
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  return errors[errors.size() / 2];
}

TEST(SyntheticBuilding, LeftAndRightAgreeAtTheTrueDisparity) {
  for (const int walk : {0, kBuildingStairs}) {
    const auto source = open_synthetic_stereo_source(walk_name(walk, "&noise=0&blur=0"));
    EXPECT_EQ(source->calibration()->right_from_left.t, Vector3d(-0.119, 0, 0));
    EXPECT_EQ(source->frames_per_second(), 20);
    EXPECT_EQ(source->frame_count(), building_walk_frames(walk));
    for (const int index : {0, 480, 700}) {
      const double error = disparity_error(*source, index, 0);
      EXPECT_GE(error, 0) << "too little to see, walk " << walk << " frame " << index;
      EXPECT_LT(error, 3) << "walk " << walk << " frame " << index;
      for (const double shift : {-1.0, 1.0})
        EXPECT_GT(disparity_error(*source, index, shift), 3 * error) << "walk " << walk << " frame " << index;
    }
  }
}

TEST(SyntheticBuilding, DepthIsThatOfTheFirstSurfaceOnTheRay) {
  // The ray caster leaves out what is hidden; this reference looks at every surface.
  for (int walk = 0; walk < kBuildingWalks; ++walk) {
    const auto source = open_synthetic_source(walk_name(walk, "&size=128x96"));
    int checked = 0, different = 0;
    for (int index = 20; index < source->frame_count(); index += source->frame_count() / 3) {
      const cv::Mat1f depth = source->depth(index);
      const RigidTransform world_from_camera = source->world_from_camera(index);
      for (int y = 1; y < depth.rows; y += 5)
        for (int x = 1; x < depth.cols; x += 5) {
          Vector3d ray;
          ASSERT_TRUE(source->calibration()->unproject(Vector2d(x, y), &ray));
          const auto hit = source->scene().cast(world_from_camera.t, world_from_camera.R * ray);
          ASSERT_TRUE(hit) << "a hole in the building: walk " << walk << " frame " << index << " at " << x << ", " << y;
          ++checked;
          different += std::abs(depth(y, x) - hit->distance) > 1e-4 * hit->distance;
        }
    }
    EXPECT_GT(checked, 1200);
    EXPECT_LE(different, checked / 300) << "walk " << walk;
  }
}

TEST(SyntheticBuilding, NothingIsNearerThanAnArmAndNothingIsOpen) {
  for (int walk = 0; walk < kBuildingWalks; ++walk) {
    const auto source = open_synthetic_source(walk_name(walk, "&size=64x48&day=3"));
    for (int index = 0; index < source->frame_count(); index += 40) {
      const Vector3d eye = source->world_from_camera(index).t;
      for (int i = 0; i < 14; ++i) {
        const double angle = (i + 0.37) * 2 * std::numbers::pi / 14, tilt = i % 2 ? 0.0 : std::sin(0.7 * i);
        const auto hit = source->scene().cast(eye, Vector3d(std::cos(angle), std::sin(angle), tilt).normalized());
        ASSERT_TRUE(hit) << "walk " << walk << " frame " << index;
        ASSERT_GT(hit->distance, 0.3) << "walk " << walk << " frame " << index;
        ASSERT_LT(hit->distance, 45) << "walk " << walk << " frame " << index;
      }
    }
  }
}

TEST(SyntheticBuilding, WalksKeepTheirSpeed) {
  for (int walk = 0; walk < kBuildingWalks; ++walk) {
    const bool wheels = walk <= 2;
    const SyntheticMotion motion = building_motion(walk, 9);
    const int frames = building_walk_frames(walk);
    double travelled = 0;
    for (int i = 1; i < frames; ++i) {
      const RigidTransform a = motion.world_from_camera(i - 1, 0), b = motion.world_from_camera(i, 0);
      const double speed = (b.t - a.t).norm() * kBuildingFps, turn = (a.inverse() * b).angle() * kBuildingFps;
      travelled += (b.t - a.t).norm();
      ASSERT_LT(speed, wheels ? 0.8 : 1.4) << "walk " << walk << " frame " << i;
      ASSERT_LT(turn * 180 / std::numbers::pi, wheels ? 46 : 90) << "walk " << walk << " frame " << i;
      if (wheels && i > 60) {
        ASSERT_GT(speed, 0.3) << "walk " << walk << " frame " << i;
      }
      // No jump where one frame's time ends and the next one's begins.
      const double half = 0.5 / kBuildingFps;
      const RigidTransform end = motion.world_from_camera(i - 1, half), start = motion.world_from_camera(i, -half);
      ASSERT_LT((end.t - start.t).norm(), 1e-9) << i;
      ASSERT_LT((end.inverse() * start).angle(), 1e-7) << i;
    }
    if (wheels) {
      EXPECT_NEAR(travelled / (frames / kBuildingFps), 0.62, 0.06) << "walk " << walk;
    }
  }
}

TEST(SyntheticBuilding, TheLoopCloses) {
  const SyntheticMotion motion = building_motion(0, 3);
  const int frames = building_walk_frames(0);
  const RigidTransform early = motion.world_from_camera(120, 0);
  double nearest = 1e9, angle = 0, farthest = 0;
  for (int i = 1000; i < frames; ++i) {
    const RigidTransform late = motion.world_from_camera(i, 0);
    if ((late.t - early.t).norm() < nearest) {
      nearest = (late.t - early.t).norm();
      angle = (early.inverse() * late).angle();
    }
    farthest = std::max(farthest, (late.t - early.t).norm());
  }
  EXPECT_LT(nearest, 0.3);
  EXPECT_LT(angle, 0.3);
  EXPECT_GT(farthest, 28);
  // And goes on, not on quite the same line.
  const RigidTransform later = motion.world_from_camera(40'000, 0);
  EXPECT_LT(std::abs(later.t.z() - 1.1), 0.01);
  EXPECT_GT(later.t.x(), -1.1);
  EXPECT_LT(later.t.x(), kBuildingLength + 1.1);
}

TEST(SyntheticBuilding, TheStairsClimbOneStorey) {
  for (const int walk : {4, kBuildingStairs}) {
    const SyntheticMotion motion = building_motion(walk, 5);
    const int frames = building_walk_frames(walk);
    EXPECT_NEAR(motion.world_from_camera(frames - 1, 0).t.z() - motion.world_from_camera(0, 0).t.z(), kUpperFloor,
                0.05);
    int on_landing = 0;
    for (int i = 0; i < frames; ++i) {
      const Vector3d eye = motion.world_from_camera(i, 0).t;
      on_landing += eye.x() < kStairsTurn && std::abs(eye.z() - 1.45 - kUpperFloor / 2) < 0.1;
    }
    EXPECT_GT(on_landing, 20);
    // Ends there and stands still.
    const double apart = (motion.world_from_camera(frames + 400, 0).t - motion.world_from_camera(frames, 0).t).norm();
    EXPECT_LT(apart, 0.05);
  }
}

TEST(SyntheticBuilding, FramesDependOnNameAndIndexOnly) {
  const std::string name = walk_name(2, "&size=192x144&seed=7");
  const auto a = open_synthetic_stereo_source(name), b = open_synthetic_stereo_source(name + "&threads=2");
  const StereoFrame first = a->frame(300), other = a->frame(40);
  EXPECT_TRUE(same_bytes(b->frame(40).right.grey, other.right.grey));
  EXPECT_TRUE(same_bytes(b->frame(300).left.grey, first.left.grey));
  EXPECT_TRUE(same_bytes(b->frame(300).right.grey, first.right.grey));
  EXPECT_FALSE(same_bytes(first.left.grey, first.right.grey));
  // A later start is the same walk; one camera alone sees what the left one sees.
  const auto late = open_synthetic_source(name + "&start=260&noise=0"),
             whole = open_synthetic_source(name + "&noise=0");
  EXPECT_TRUE(same_bytes(late->frame(40).grey, whole->frame(300).grey));
  EXPECT_EQ(late->frame_count() + 260, whole->frame_count());
  EXPECT_TRUE(same_bytes(open_synthetic_source(name)->frame(300).grey, first.left.grey));
  SourceOptions range;
  range.start_frame = 300;
  range.max_frames = 1;
  const auto sequential = open_synthetic_stereo_source(name, range);
  const auto frame = sequential->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->left.index, 300);
  EXPECT_EQ(frame->right.index, 300);
  EXPECT_EQ(frame->right.time, frame->left.time);
  EXPECT_TRUE(same_bytes(frame->right.grey, first.right.grey));
  EXPECT_FALSE(sequential->next());
}

TEST(SyntheticBuilding, AnotherDayMovesSomeThingsAndNoWalls) {
  const auto monday = open_synthetic_source(walk_name(0, "&noise=0&size=256x192"));
  const auto tuesday = open_synthetic_source(walk_name(0, "&noise=0&size=256x192&day=2"));
  int repainted = 0, moved = 0, all = 0;
  for (const int index : {0, 400, 1900}) {
    EXPECT_LT((monday->world_from_camera(index).t - tuesday->world_from_camera(index).t).norm(), 1e-12);
    const cv::Mat1f a = monday->depth(index), b = tuesday->depth(index);
    const cv::Mat1b grey_a = monday->frame(index).grey, grey_b = tuesday->frame(index).grey;
    for (int y = 0; y < a.rows; ++y)
      for (int x = 0; x < a.cols; ++x) {
        ++all;
        moved += std::abs(a(y, x) - b(y, x)) > 0.02 * a(y, x);
        repainted += std::abs(grey_a(y, x) - grey_b(y, x)) > 25;
      }
  }
  EXPECT_GT(repainted, all / 200);
  EXPECT_LT(repainted, all / 3);
  EXPECT_GT(moved, all / 2000);
  EXPECT_LT(moved, all / 5);
}

TEST(SyntheticBuilding, BadKeysAreOneClearLine) {
  for (const char* bad : {"walk=5", "walk=lift", "start=-1", "lens=fov", "baseline=0", "target=circles"}) {
    try {
      open_synthetic_source("synthetic:building?" + std::string(bad));
      ADD_FAILURE() << bad;
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("expected"), std::string::npos) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
  }
}

}  // namespace
}  // namespace parallax
