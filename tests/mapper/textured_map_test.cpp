#include "mapper/textured_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <set>
#include <tuple>
#include <vector>

#include "core/error.h"
#include "tests/support/rendered_views.h"
#include "tests/support/statistics.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kBaseline = 0.06;
constexpr int kKeyframes = 3;

StereoCamera stereo_camera() {
  const CameraModel& lens = test::small_camera();
  // One focal length across, as the rendered views have.
  return {lens.width(), lens.height(), lens.focal_px(), lens.centre_px(), kBaseline};
}

// Keyframes along the desk: left cameras are even views, right ones odd.
test::RenderedViews& pairs() {
  static test::RenderedViews views([] {
    std::vector<RigidTransform> poses;
    for (int i = 0; i < kKeyframes; ++i) {
      poses.push_back(test::above_desk(-0.05 + 0.05 * i));
      poses.push_back(poses.back() *
                      RigidTransform(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), Vector3d(kBaseline, 0, 0)));
    }
    return poses;
  }());
  return views;
}

RigidTransform pose(int i) { return pairs().camera_from_world(2 * i).inverse(); }

cv::Mat1f true_depth(int i) {
  cv::Mat1f depth(240, 320, 0.0F);
  for (int y = 0; y < depth.rows; y += 2)
    for (int x = 0; x < depth.cols; x += 2) depth(y, x) = static_cast<float>(pairs().depth(2 * i, Vector2d(x, y)));
  return depth;
}

TexturedKeyframe keyframe(int i) { return {i, pose(i), pairs().frame(2 * i).grey, pairs().frame(2 * i + 1).grey, {}}; }

TexturedMapOptions desk_options() {
  TexturedMapOptions options;
  options.voxel_m = 0.01;
  options.disparity.nearest_m = 0.25;
  return options;
}

TEST(DenseDisparity, IsThatOfTheTrueDepth) {
  const StereoCamera camera = stereo_camera();
  DisparityOptions options;
  options.nearest_m = 0.25;
  DenseDisparity dense(camera, options);
  EXPECT_EQ(dense.most_disparity_px(), 48);
  const TexturedKeyframe view = keyframe(0);
  const cv::Mat1f found = dense.compute(view.left, view.right), depth = true_depth(0);
  std::vector<double> errors;
  int known = 0, possible = 0, wrong = 0;
  for (int y = 0; y < found.rows; y += 2) {
    for (int x = 0; x < found.cols; x += 2) {
      if (!(depth(y, x) > 0)) continue;
      ++possible;
      if (!(found(y, x) > 0)) continue;
      ++known;
      const double error = std::abs(found(y, x) - camera.disparity_px(depth(y, x)));
      errors.push_back(error);
      wrong += error > 1.5;
    }
  }
  EXPECT_GT(known, 0.4 * possible);
  EXPECT_LT(testing::median(errors), 0.15);
  EXPECT_LT(wrong, 0.06 * known);
  // Again, to the last bit; nothing where there is nothing.
  EXPECT_EQ(cv::norm(found, DenseDisparity(camera, options).compute(view.left, view.right), cv::NORM_INF), 0);
  const GreyImage blank(240, 320, uchar{90});
  EXPECT_EQ(cv::countNonZero(dense.compute(blank, blank)), 0);
}

TEST(TexturedMap, FusedPointsLieWhereTheSceneIs) {
  TexturedMap map(stereo_camera(), desk_options());
  for (int i = 0; i < kKeyframes; ++i) map.add(keyframe(i));
  EXPECT_EQ(map.keyframes(), kKeyframes);
  const std::vector<ColouredPoint> points = map.points();
  ASSERT_GT(points.size(), 2000U);
  // Along the ray from the middle keyframe.
  const RigidTransform camera_from_world = pairs().camera_from_world(2);
  std::vector<double> errors;
  int unlike = 0;
  const GreyImage image = keyframe(1).left;
  for (std::size_t i = 0; i < points.size(); i += 4) {
    const ColouredPoint& point = points[i];
    const Vector3d here = camera_from_world * point.position.cast<double>();
    Vector2d pixel;
    if (!pairs().camera().project(here, &pixel) || !pairs().camera().in_image(pixel, 1)) continue;
    errors.push_back(std::abs(pairs().depth(2, pixel) / here.z() - 1));
    unlike += std::abs(image(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x()))) -
                       point.rgb[0]) > 40;
    EXPECT_EQ(point.rgb[0], point.rgb[2]);
    EXPECT_GT(point.sigma_m, 0);
  }
  ASSERT_GT(errors.size(), 400U);
  EXPECT_LT(testing::median(errors), 0.01);
  EXPECT_LT(unlike, 0.1 * static_cast<double>(errors.size()));
  // One point a voxel.
  std::set<std::tuple<long, long, long>> voxels;
  for (const ColouredPoint& point : points) {
    const Eigen::Array3d cell = (point.position.cast<double>() / map.voxel_m()).array().floor();
    voxels.emplace(std::lround(cell.x()), std::lround(cell.y()), std::lround(cell.z()));
  }
  EXPECT_GE(voxels.size(), 0.99 * static_cast<double>(points.size()));  // floats round over a border now and then
}

// Flat walls across the view at known depths.
struct Walls {
  StereoCamera camera{64, 48, {50, 50}, {31.5, 23.5}, 0.1};
  TexturedMapOptions options = [] {
    TexturedMapOptions o;
    o.least_views = 1;
    o.step_px = 1;
    o.disparity_sigma_px = 0.05;
    o.voxel_m = 0.05;
    return o;
  }();
  TexturedMap map{camera, options};

  void add(int number, double depth, std::uint8_t grey, const RigidTransform& world_from_camera = {}) {
    const cv::Mat1f disparity(48, 64, static_cast<float>(camera.disparity_px(depth)));
    map.add({number, world_from_camera, GreyImage(48, 64, grey), GreyImage(48, 64, grey), {}}, disparity);
  }
  int between(double from, double to) {
    const auto points = map.points();
    return static_cast<int>(std::count_if(points.begin(), points.end(), [&](const ColouredPoint& p) {
      return p.position.z() > from && p.position.z() < to;
    }));
  }
};

TEST(TexturedMap, WhatIsSeenThroughGoes) {
  Walls walls;
  walls.add(0, 1.0, 50);
  const int wall = walls.between(0.9, 1.1);
  EXPECT_GT(wall, 200);
  walls.add(1, 1.0, 60);
  EXPECT_EQ(walls.between(0.9, 1.1), static_cast<int>(walls.map.size()));
  walls.add(2, 1.5, 70);  // one against two
  EXPECT_GE(walls.between(0.9, 1.1), wall);
  walls.add(3, 1.5, 70);
  EXPECT_EQ(walls.between(0.9, 1.1), 0);
  EXPECT_GT(walls.between(1.4, 1.6), 200);
  // A wall before another hides it and takes nothing away.
  walls.add(4, 1.0, 80);
  EXPECT_GT(walls.between(1.4, 1.6), 200);
}

TEST(TexturedMap, PointsAreSurerWithEveryViewAndGoWithTheirKeyframe) {
  Walls walls;
  walls.add(0, 1.02, 50);
  const float once = walls.map.points()[0].sigma_m;
  walls.add(1, 1.03, 60);
  const auto twice = walls.map.points();
  const auto axis = std::min_element(twice.begin(), twice.end(), [](const ColouredPoint& a, const ColouredPoint& b) {
    return a.position.head<2>().norm() < b.position.head<2>().norm();
  });
  const auto middle = static_cast<std::size_t>(axis - twice.begin());
  EXPECT_NEAR(twice[middle].sigma_m, once / std::sqrt(2), 0.02 * once);
  EXPECT_NEAR(twice[middle].position.z(), 1.025, 0.001);
  EXPECT_EQ(twice[middle].rgb[0], 50);  // seen as near as then
  walls.map.move(7, {});                // unknown
  const RigidTransform moved(Eigen::Matrix3d(exp_so3({0, 0, 0.3})), Vector3d(2, 0, 5));
  walls.map.move(0, moved);
  const auto after = walls.map.points();
  ASSERT_GT(after.size(), twice.size() / 2);
  for (const ColouredPoint& p : after) EXPECT_NEAR(p.position.z(), 6.025, 0.01);
  EXPECT_LT((after[0].position.cast<double>() - moved * twice[0].position.cast<double>()).norm(), 1e-5);
  // Where it was there is room again; and brought back, two sheets become one.
  walls.add(2, 1.02, 90);
  EXPECT_GT(walls.between(0.9, 1.1), 200);
  walls.map.move(0, {});
  EXPECT_LE(walls.map.points().size(), 27U * 20U);  // voxels of 5 cm in 1.3 m by 0.98 m
}

TEST(TexturedMap, VoxelsGrowWhenThereAreTooManyPoints) {
  Walls walls;
  TexturedMapOptions options = walls.options;
  options.most_points = 1000;
  options.voxel_m = 0.002;
  TexturedMap map(walls.camera, options);
  for (int i = 0; i < 5; ++i) {
    const cv::Mat1f disparity(48, 64, static_cast<float>(walls.camera.disparity_px(1.0)));
    const GreyImage grey(48, 64, uchar{9});
    map.add({i, RigidTransform(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), Vector3d(2.0 * i, 0, 0)), grey, grey, {}},
            disparity);
    EXPECT_LE(map.size(), 1000U);
  }
  EXPECT_GT(map.voxel_m(), 0.01);
  const auto points = map.points();
  EXPECT_EQ(points.size(), map.size());
  EXPECT_GT(points.size(), 300U);
  EXPECT_GT(points.back().position.x(), 7);
}

TEST(TexturedMap, RefusesOptionsThatMakeNoSense) {
  TexturedMapOptions options;
  options.voxel_m = 0;
  EXPECT_THROW(TexturedMap(stereo_camera(), options), InputError);
  options = {};
  options.disparity.block_px = 4;
  EXPECT_THROW(TexturedMap(stereo_camera(), options), InputError);
}

}  // namespace
}  // namespace parallax
