#include "mapper/point_measurer.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

const Map& map() {
  static const Map m = test::true_map(&desk_views(), {2}, 100);
  return m;
}

TEST(PointMeasurer, MeasuresPointsWhereTheyAre) {
  const CameraModel& camera = desk_views().camera();
  const RigidTransform source = desk_views().camera_from_world(2);
  for (int view : {3, 5}) {
    int visible = 0, found = 0;
    std::vector<double> errors;
    for (const MapPoint& p : map().points) {
      const auto truth = desk_views().project_visible(view, p.position, 20);
      if (!truth) continue;
      ++visible;
      const auto predicted = predict_patch(camera, p, source, desk_views().camera_from_world(view));
      ASSERT_TRUE(predicted);
      EXPECT_NEAR((predicted->pixel - *truth).norm(), 0, 1e-9);
      EXPECT_EQ(predicted->level, target_level(predicted->warp.determinant()));
      const auto m = measure_point(p, *desk_views().images(2), *predicted, *desk_views().images(view), 4,
                                   MeasurementSource::refind);
      if (!m) continue;
      ++found;
      EXPECT_EQ(m->point, p.id);
      EXPECT_EQ(m->level, predicted->level);
      EXPECT_EQ(m->sigma_px, level_scale(predicted->level));
      EXPECT_EQ(m->source, MeasurementSource::refind);
      errors.push_back((m->pixel - *truth).norm() / level_scale(m->level));
    }
    ASSERT_GT(visible, 80);
    EXPECT_GT(found, 0.85 * visible);
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.15) << "pixels of the level";
    EXPECT_LT(errors[errors.size() * 9 / 10], 0.6);
  }
}

TEST(PointMeasurer, APredictionALittleOffIsCorrected) {
  const CameraModel& camera = desk_views().camera();
  int tried = 0, right = 0;
  for (const MapPoint& p : map().points) {
    const auto truth = desk_views().project_visible(3, p.position, 30);
    auto predicted =
        truth ? predict_patch(camera, p, desk_views().camera_from_world(2), desk_views().camera_from_world(3))
              : std::nullopt;
    if (!predicted) continue;
    ++tried;
    predicted->pixel += Eigen::Vector2d(1.8, -1.6) * level_scale(predicted->level);
    const auto m =
        measure_point(p, *desk_views().images(2), *predicted, *desk_views().images(3), 4, MeasurementSource::refind);
    right += m && (m->pixel - *truth).norm() < 0.75 * level_scale(m->level) ? 1 : 0;
    // Out of the radius, nothing is taken for it.
    const auto tight = measure_point(p, *desk_views().images(2), *predicted, *desk_views().images(3), 1.5,
                                     MeasurementSource::second_chance);
    if (tight) {
      EXPECT_LE((tight->pixel - predicted->pixel).norm(), 2.0 * level_scale(tight->level) + 1e-9);
    }
  }
  EXPECT_GT(right, 0.75 * tried);
}

// Half the light, or half as much again: what was found is found again at the same place; only when asked for.
TEST(PointMeasurer, AnotherLightIsSeenThrough) {
  const CameraModel& camera = desk_views().camera();
  for (double light : {0.5, 1.5}) {
    GreyImage lit;
    desk_views().frame(3).grey.convertTo(lit, -1, light, light < 1 ? 20 : -20);
    const auto image = test::features_of(lit);
    int in_the_same = 0, without = 0, with = 0;
    std::vector<double> apart;
    for (const MapPoint& p : map().points) {
      const auto predicted =
          predict_patch(camera, p, desk_views().camera_from_world(2), desk_views().camera_from_world(3));
      if (!predicted) continue;
      const auto look = [&](const FrameImages& target, bool other_light) {
        return measure_point(p, *desk_views().images(2), *predicted, target, 4, MeasurementSource::refind, other_light);
      };
      const auto same = look(*desk_views().images(3), false), found = look(*image, true);
      in_the_same += same ? 1 : 0;
      without += look(*image, false) ? 1 : 0;
      with += found ? 1 : 0;
      if (same && found) apart.push_back((same->pixel - found->pixel).norm() / level_scale(same->level));
    }
    std::printf("light %.1f: %d, %d without and %d with\n", light, in_the_same, without, with);
    ASSERT_GT(in_the_same, 50);
    EXPECT_LT(without, 0.8 * in_the_same);
    EXPECT_GT(with, 0.9 * in_the_same);
    std::sort(apart.begin(), apart.end());
    EXPECT_LT(apart[apart.size() / 2], 0.05);
    EXPECT_LT(apart[apart.size() * 9 / 10], 0.3);
  }
}

TEST(PointMeasurer, WhatCannotBeSeenIsNotPredicted) {
  const CameraModel& camera = desk_views().camera();
  const RigidTransform source = desk_views().camera_from_world(2);
  const MapPoint& p = *map().points.begin();
  const RigidTransform turned = RigidTransform(exp_so3({0, M_PI, 0}), Eigen::Vector3d::Zero()) * source;
  EXPECT_FALSE(predict_patch(camera, p, source, turned)) << "behind";
  const RigidTransform aside = RigidTransform(exp_so3({0, 1.0, 0}), Eigen::Vector3d::Zero()) * source;
  EXPECT_FALSE(predict_patch(camera, p, source, aside)) << "out of the image";
  // From the other side of its surface.
  const Eigen::Vector3d below = p.position - 0.5 * p.normal;
  EXPECT_FALSE(predict_patch(camera, p, source, look_at(below, p.position).inverse()));
  const Eigen::Vector3d above = p.position + 0.6 * p.normal;
  EXPECT_TRUE(predict_patch(camera, p, source, look_at(above + Eigen::Vector3d(0, -0.02, 0), p.position).inverse()));
  const Eigen::Vector3d far = p.position + 20 * p.normal;
  EXPECT_FALSE(predict_patch(camera, p, source, look_at(far + Eigen::Vector3d(0, -0.02, 0), p.position).inverse()))
      << "too small";
}

TEST(PointMeasurer, NothingIsFoundInABlankImage) {
  const CameraModel& camera = desk_views().camera();
  const auto blank = test::features_of(GreyImage(240, 320, static_cast<std::uint8_t>(90)));
  for (const MapPoint& p : map().points) {
    const auto predicted =
        predict_patch(camera, p, desk_views().camera_from_world(2), desk_views().camera_from_world(3));
    if (predicted) {
      for (bool other_light : {false, true})
        EXPECT_FALSE(
            measure_point(p, *desk_views().images(2), *predicted, *blank, 4, MeasurementSource::refind, other_light));
    }
  }
}

}  // namespace
}  // namespace parallax
