#include "map/source_patch.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

CameraModel fov_camera() { return {CameraModelKind::fov, 640, 480, {375, 376}, {321, 238}, {0.9}, 1}; }
CameraModel radtan_camera() {
  return {CameraModelKind::radtan, 640, 480, {390, 391}, {318, 241}, {-0.26, 0.07, 4e-4, -3e-4}, 4};
}

// A point whose patch is on a slanted plane, made from a pixel of `level` in a camera that is somewhere in the world.
struct Setting {
  MapPoint point;
  RigidTransform source_from_world;
};

Setting slanted(const CameraModel& camera, int level, const Eigen::Vector2d& level_px) {
  Setting s;
  s.source_from_world = RigidTransform(exp_so3({0.3, -0.2, 0.5}), Eigen::Vector3d(0.2, -0.1, 0.4));
  EXPECT_TRUE(set_source(&s.point, {0, 0}, level, level_px, camera));
  const RigidTransform world_from_source = s.source_from_world.inverse();
  s.point.position = world_from_source * (s.point.source_rays.col(0) * 0.8);
  s.point.normal = world_from_source.R * Eigen::Vector3d(0.3, -0.4, -1).normalized();
  return s;
}

// Where source pixel p sees the patch's plane, in the world.
Eigen::Vector3d on_plane(const Setting& s, const CameraModel& camera, const Eigen::Vector2d& level_px) {
  Eigen::Vector3d ray;
  EXPECT_TRUE(camera.unproject(level_to_level0(level_px, s.point.source_level), &ray));
  const RigidTransform world_from_source = s.source_from_world.inverse();
  const Eigen::Vector3d direction = world_from_source.R * ray;
  const double distance = s.point.normal.dot(s.point.position - world_from_source.t) / s.point.normal.dot(direction);
  return world_from_source.t + distance * direction;
}

TEST(SourcePatch, SourceRaysGoThroughThePixelAndItsNeighbours) {
  const CameraModel camera = fov_camera();
  MapPoint p;
  ASSERT_TRUE(set_source(&p, {0, 4}, 2, {40.25, 33.5}, camera));
  EXPECT_EQ(p.source, (KeyframeId{0, 4}));
  EXPECT_EQ(p.source_level, 2);
  const Eigen::Vector2d offsets[3] = {{0, 0}, {1, 0}, {0, 1}};
  for (int k = 0; k < 3; ++k) {
    Eigen::Vector2d px;
    ASSERT_TRUE(camera.project(p.source_rays.col(k), &px));
    EXPECT_NEAR((level0_to_level(px, 2) - (Eigen::Vector2d(40.25, 33.5) + offsets[k])).norm(), 0, 1e-9);
  }
}

TEST(SourcePatch, ANeighbourWithoutARayIsRefused) {
  // The fov lens ends where omega r = pi / 2: 654 px from the centre.
  MapPoint p;
  p.source_level = 9;
  EXPECT_FALSE(set_source(&p, {0, 0}, 0, {321 + 375 * (M_PI / 2 / 0.9) - 0.5, 238}, fov_camera()));
  EXPECT_EQ(p.source_level, 9) << "left as it was";
}

TEST(SourcePatch, AxesAreOnePixelOnThePlane) {
  for (const CameraModel& camera : {fov_camera(), radtan_camera()}) {
    for (int level = 0; level < kPyramidLevels; ++level) {
      const Eigen::Vector2d px = level0_to_level({200, 150}, level);
      const Setting s = slanted(camera, level, px);
      Eigen::Matrix<double, 3, 2> axes;
      ASSERT_TRUE(patch_axes(s.point, s.source_from_world, &axes));
      const Eigen::Vector3d centre = on_plane(s, camera, px);
      EXPECT_NEAR((centre - s.point.position).norm(), 0, 1e-9);
      EXPECT_NEAR((axes.col(0) - (on_plane(s, camera, px + Eigen::Vector2d(1, 0)) - centre)).norm(), 0, 1e-9);
      EXPECT_NEAR((axes.col(1) - (on_plane(s, camera, px + Eigen::Vector2d(0, 1)) - centre)).norm(), 0, 1e-9);
    }
  }
}

TEST(SourcePatch, AxesOfAFacingPatch) {
  const CameraModel& camera = test::flat_camera();
  MapPoint p;
  ASSERT_TRUE(set_source(&p, {0, 0}, 1, level0_to_level(camera.centre_px(), 1), camera));
  p.position = {0, 0, 2};
  p.normal = {0, 0, -1};
  Eigen::Matrix<double, 3, 2> axes;
  ASSERT_TRUE(patch_axes(p, RigidTransform(), &axes));
  EXPECT_NEAR((axes.col(0) - Eigen::Vector3d(2 * 2.0 / 300, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((axes.col(1) - Eigen::Vector3d(0, 2 * 2.0 / 310, 0)).norm(), 0, 1e-12);
}

TEST(SourcePatch, EdgeOnAndFromBehindHaveNoAxes) {
  Setting s = slanted(fov_camera(), 0, {321, 238});
  Eigen::Matrix<double, 3, 2> axes;
  const Eigen::Matrix3d world_from_source = s.source_from_world.R.transpose();
  s.point.normal = world_from_source * Eigen::Vector3d(1, 0, -0.02).normalized();
  EXPECT_FALSE(patch_axes(s.point, s.source_from_world, &axes));
  s.point.normal = world_from_source * Eigen::Vector3d(0, 0, 1);
  EXPECT_FALSE(patch_axes(s.point, s.source_from_world, &axes));
  s.point.normal = world_from_source * Eigen::Vector3d(1, 0, -0.2).normalized();
  EXPECT_TRUE(patch_axes(s.point, s.source_from_world, &axes));
}

TEST(SourcePatch, WarpIsTheDerivativeOfTheTargetPixel) {
  const CameraModel camera = fov_camera();
  for (int level : {0, 2}) {
    const Eigen::Vector2d px = level0_to_level({250, 290}, level);
    const Setting s = slanted(camera, level, px);
    const RigidTransform target_from_world =
        RigidTransform(exp_so3({-0.1, 0.15, 0.4}), Eigen::Vector3d(0.1, 0.05, -0.1)) * s.source_from_world;
    Eigen::Matrix<double, 3, 2> axes;
    ASSERT_TRUE(patch_axes(s.point, s.source_from_world, &axes));
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> jacobian;
    ASSERT_TRUE(camera.project(target_from_world * s.point.position, &pixel, &jacobian));
    const Eigen::Matrix2d A = warp_matrix(jacobian, target_from_world.R, axes);
    // Numerically, from source pixels through the plane into the target. The axes are one-sided differences over a
    // whole pixel, so they agree with the derivative to first order in the pixel's size.
    for (int k = 0; k < 2; ++k) {
      const double h = 1e-4;
      Eigen::Vector2d step = Eigen::Vector2d::Zero();
      step[k] = h;
      Eigen::Vector2d plus, minus;
      ASSERT_TRUE(camera.project(target_from_world * on_plane(s, camera, px + step), &plus));
      ASSERT_TRUE(camera.project(target_from_world * on_plane(s, camera, px - step), &minus));
      const Eigen::Vector2d numeric = (plus - minus) / (2 * h);
      EXPECT_NEAR((A.col(k) - numeric).norm(), 0, 0.006 * numeric.norm() * level_scale(level));
      // Exactly: the projection's derivative along the axis.
      ASSERT_TRUE(camera.project(target_from_world * (s.point.position + h * axes.col(k)), &plus));
      ASSERT_TRUE(camera.project(target_from_world * (s.point.position - h * axes.col(k)), &minus));
      EXPECT_NEAR((A.col(k) - (plus - minus) / (2 * h)).norm(), 0, 1e-6);
    }
  }
}

TEST(SourcePatch, TargetLevelIsTheOneSeenAtNearestToItsOwnSize) {
  EXPECT_EQ(target_level(1.0), 0);
  EXPECT_EQ(target_level(1.9), 0);
  EXPECT_EQ(target_level(2.1), 1);
  EXPECT_EQ(target_level(4.0), 1);
  EXPECT_EQ(target_level(16.0), 2);
  EXPECT_EQ(target_level(64.0), 3);
  EXPECT_EQ(target_level(64.0 * 3.4), 3);
  EXPECT_EQ(target_level(64.0 * 3.6), -1) << "too large for the highest level";
  EXPECT_EQ(target_level(1 / 3.4), 0);
  EXPECT_EQ(target_level(1 / 3.6), -1) << "too small for the lowest";
  EXPECT_EQ(target_level(1 / 3.6, 4.0), 0);
  EXPECT_EQ(target_level(0), -1);
  EXPECT_EQ(target_level(-1), -1) << "mirrored: seen from behind";
  EXPECT_EQ(target_level(std::numeric_limits<double>::quiet_NaN()), -1);
  // No other level has a ratio nearer to one.
  for (double det = 0.3; det < 200; det *= 1.07) {
    const int level = target_level(det);
    ASSERT_GE(level, 0) << det;
    const auto off = [&](int l) { return std::abs(std::log(det / std::pow(4.0, l))); };
    for (int l = 0; l < kPyramidLevels; ++l) EXPECT_LE(off(level), off(l) + 1e-9) << det;
  }
}

TEST(SourcePatch, TemplateOfTheSameViewIsTheSourceItself) {
  const auto images = test::noise_images(320, 240, 5);
  for (int level : {0, 1}) {
    PatchTemplate block;
    ASSERT_TRUE(copy_patch(images->pyramid.level[level], 50, 40, &block));
    for (int target : {0, 1, 2}) {
      WarpedPatch patch;
      const Eigen::Matrix2d A = Eigen::Matrix2d::Identity() * level_scale(target);
      ASSERT_TRUE(warp_source_patch(images->pyramid, level, {50, 40}, A, target, &patch));
      EXPECT_TRUE(patch.ok);
      EXPECT_EQ(patch.level, target);
      EXPECT_EQ(patch.warp, A);
      EXPECT_FALSE(patch.alignment_ready);
      EXPECT_EQ(patch.search.pixels, block.pixels);
      EXPECT_EQ(patch.search.sum, block.sum);
    }
  }
}

TEST(SourcePatch, AWarpedTemplateIsTurnedTheRightWay) {
  // A takes source pixels to target pixels: a quarter turn clockwise on the screen.
  const auto images = test::noise_images(320, 240, 6);
  Eigen::Matrix2d A;
  A << 0, -1, 1, 0;
  WarpedPatch patch;
  ASSERT_TRUE(warp_source_patch(images->pyramid, 0, {100, 90}, A, 0, &patch));
  const GreyImage& source = images->pyramid.level[0];
  for (int j = 0; j < kPatchSize; ++j) {
    for (int i = 0; i < kPatchSize; ++i) {
      const Eigen::Vector2d s = Eigen::Vector2d(100, 90) + A.inverse() * Eigen::Vector2d(i - 4, j - 4);
      EXPECT_EQ(patch.search.pixels[static_cast<std::size_t>(j * kPatchSize + i)],
                source(static_cast<int>(std::lround(s.y())), static_cast<int>(std::lround(s.x()))));
    }
  }
}

TEST(SourcePatch, APatchThatLeavesItsSourceIsRefused) {
  const auto images = test::noise_images(320, 240, 5);
  WarpedPatch patch;
  patch.ok = true;
  EXPECT_FALSE(warp_source_patch(images->pyramid, 0, {2, 40}, Eigen::Matrix2d::Identity(), 0, &patch));
  EXPECT_FALSE(patch.ok);
  // At the rim the 8x8 fits and the 10x10 of the alignment does not: it is made from the 8x8.
  ASSERT_TRUE(warp_source_patch(images->pyramid, 0, {4, 40}, Eigen::Matrix2d::Identity(), 0, &patch));
  prepare_alignment(images->pyramid, 0, {4, 40}, &patch);
  EXPECT_TRUE(patch.alignment_ready);
  EXPECT_TRUE(patch.alignment.valid);
}

TEST(SourcePatch, ThresholdGrowsWithContrastWithinLimits) {
  PatchTemplate flat;
  flat.pixels.fill(100);
  finish_template(&flat);
  EXPECT_EQ(zmssd_threshold(flat), 80 * kPatchPixels);
  int last = zmssd_threshold(flat);
  for (int amplitude : {10, 20, 30}) {
    PatchTemplate t;
    for (int i = 0; i < kPatchPixels; ++i)
      t.pixels[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(i % 2 ? 100 + amplitude : 100 - amplitude);
    finish_template(&t);
    EXPECT_GT(zmssd_threshold(t), last);
    // Something as contrasty that has nothing in common with the template is over the threshold.
    if (amplitude >= 20) {
      EXPECT_LT(zmssd_threshold(t), 2 * amplitude * amplitude * kPatchPixels);
    }
    last = zmssd_threshold(t);
  }
  PatchTemplate strong;
  for (int i = 0; i < kPatchPixels; ++i) strong.pixels[static_cast<std::size_t>(i)] = i % 2 ? 255 : 0;
  finish_template(&strong);
  EXPECT_EQ(zmssd_threshold(strong), 600 * kPatchPixels);
}

}  // namespace
}  // namespace parallax
