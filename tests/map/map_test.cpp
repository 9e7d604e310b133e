#include "map/map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using test::fabricate_map;
using test::FabricatedMap;
using test::flat_camera;

std::string joined(const std::vector<std::string>& lines) {
  std::string out;
  for (const std::string& l : lines) out += l + "\n";
  return out;
}

#define EXPECT_SOUND(map) EXPECT_EQ(joined(check_consistency(map, flat_camera())), "")

TEST(Map, MeasurementsAreKeptSortedAndInStepOnBothSides) {
  FabricatedMap f = fabricate_map();
  EXPECT_SOUND(f.map);
  const KeyframeId kf = f.keyframes[1];
  ASSERT_TRUE(f.map.remove_measurement(kf, f.points[4]));
  EXPECT_FALSE(f.map.remove_measurement(kf, f.points[4]));
  EXPECT_FALSE(f.map.remove_measurement({0, 77}, f.points[4]));
  EXPECT_EQ(f.map.keyframes.at(kf).find(f.points[4]), nullptr);
  EXPECT_EQ(f.map.points.at(f.points[4]).observers, (std::vector<KeyframeId>{f.keyframes[0], f.keyframes[2]}));
  EXPECT_SOUND(f.map);

  f.map.mark_failed(kf, f.points[4]);
  f.map.mark_failed(kf, f.points[4]);
  EXPECT_EQ(f.map.points.at(f.points[4]).failed, (std::vector<KeyframeId>{kf}));
  // A measurement lifts the failure, and a second one replaces the first.
  f.map.add_measurement(kf, {f.points[4], {10, 20}, 2.0F, 1, MeasurementSource::refind});
  f.map.add_measurement(kf, {f.points[4], {11, 21}, 4.0F, 2, MeasurementSource::second_chance});
  EXPECT_TRUE(f.map.points.at(f.points[4]).failed.empty());
  EXPECT_EQ(f.map.points.at(f.points[4]).observers.size(), 3U);
  ASSERT_NE(f.map.keyframes.at(kf).find(f.points[4]), nullptr);
  EXPECT_EQ(f.map.keyframes.at(kf).find(f.points[4])->pixel, Eigen::Vector2d(11, 21));
  EXPECT_EQ(f.map.keyframes.at(kf).find(f.points[4])->level, 2);
  EXPECT_EQ(f.map.keyframes.at(kf).measurements.size(), f.points.size());
  EXPECT_SOUND(f.map);
}

TEST(Map, ErasingAPointTakesItsMeasurementsAlong) {
  FabricatedMap f = fabricate_map();
  f.map.erase_point(f.points[3]);
  f.map.erase_point(f.points[3]);
  EXPECT_FALSE(f.map.points.contains(f.points[3]));
  for (const Keyframe& kf : f.map.keyframes) {
    EXPECT_EQ(kf.find(f.points[3]), nullptr);
    EXPECT_EQ(kf.measurements.size(), f.points.size() - 1);
  }
  EXPECT_SOUND(f.map);
}

TEST(Map, ErasingAKeyframeTakesItOutOfEveryList) {
  FabricatedMap f = fabricate_map();
  f.map.remove_measurement(f.keyframes[2], f.points[5]);
  f.map.mark_failed(f.keyframes[2], f.points[5]);
  f.map.erase_keyframe(f.keyframes[2]);
  f.map.erase_keyframe(f.keyframes[2]);
  EXPECT_EQ(f.map.keyframes.size(), 2);
  for (const MapPoint& p : f.map.points) {
    EXPECT_EQ(p.observers.size(), 2U);
    EXPECT_TRUE(p.failed.empty());
  }
  EXPECT_SOUND(f.map);
}

TEST(Map, MergingMovesWhatTheKeptPointLacks) {
  FabricatedMap f = fabricate_map();
  const PointId keep = f.points[2], drop = f.points[7];
  f.map.remove_measurement(f.keyframes[2], keep);
  f.map.mark_failed(f.keyframes[2], keep);
  f.map.remove_measurement(f.keyframes[1], drop);
  f.map.points.at(keep).searched = 5;
  f.map.points.at(keep).found = 3;
  f.map.points.at(drop).searched = 7;
  f.map.points.at(drop).found = 4;
  const Eigen::Vector2d own = f.map.keyframes.at(f.keyframes[0]).find(keep)->pixel;
  const Eigen::Vector2d moved = f.map.keyframes.at(f.keyframes[2]).find(drop)->pixel;
  f.map.merge_points(keep, drop);
  EXPECT_FALSE(f.map.points.contains(drop));
  const MapPoint& p = f.map.points.at(keep);
  EXPECT_EQ(p.observers, f.keyframes);
  EXPECT_TRUE(p.failed.empty());
  EXPECT_EQ(p.searched, 12);
  EXPECT_EQ(p.found, 7);
  EXPECT_EQ(f.map.keyframes.at(f.keyframes[0]).find(keep)->pixel, own) << "its own measurement stays";
  EXPECT_EQ(f.map.keyframes.at(f.keyframes[2]).find(keep)->pixel, moved);
  EXPECT_SOUND(f.map);
  EXPECT_THROW(f.map.merge_points(keep, keep), CheckFailure);
}

TEST(Map, AMergedPointHasOneRootAlone) {
  FabricatedMap f = fabricate_map();
  const PointId keep = f.points[2], drop = f.points[11];  // of different source keyframes
  f.map.remove_measurement(f.keyframes[1], keep);
  ASSERT_EQ(f.map.keyframes.at(f.keyframes[1]).find(drop)->source, MeasurementSource::root);
  f.map.merge_points(keep, drop);
  EXPECT_EQ(f.map.keyframes.at(f.keyframes[1]).find(keep)->source, MeasurementSource::refind);
  EXPECT_SOUND(f.map);
}

TEST(Map, MovingTheWorldChangesNoProjection) {
  FabricatedMap f = fabricate_map();
  const FabricatedMap before = fabricate_map();
  const SimilarityTransform move(2.5, exp_so3({0.4, -1.2, 0.7}), {3, -2, 1});
  f.map.transform_world(move);
  EXPECT_SOUND(f.map);
  for (KeyframeId id : f.keyframes) {
    const Keyframe &now = f.map.keyframes.at(id), &then = before.map.keyframes.at(id);
    EXPECT_NEAR((now.centre() - move * then.centre()).norm(), 0, 1e-12);
    EXPECT_NEAR(now.mean_depth, 2.5 * then.mean_depth, 1e-12);
    EXPECT_NEAR(now.depth_sigma, 2.5 * then.depth_sigma, 1e-12);
    for (PointId p : f.points) {
      Eigen::Vector2d a, b;
      ASSERT_TRUE(flat_camera().project(now.camera_from_world * f.map.points.at(p).position, &a));
      ASSERT_TRUE(flat_camera().project(then.camera_from_world * before.map.points.at(p).position, &b));
      EXPECT_NEAR((a - b).norm(), 0, 1e-9);
      const Eigen::Vector3d n_now = now.camera_from_world.R * f.map.points.at(p).normal;
      const Eigen::Vector3d n_then = then.camera_from_world.R * before.map.points.at(p).normal;
      EXPECT_NEAR((n_now - n_then).norm(), 0, 1e-12);
    }
  }
  // A place on the plane moves with it.
  const Eigen::Vector3d on_plane(0.1, -0.2, 0);
  const Eigen::Vector3d expected = move * (before.map.plane->world_from_plane * on_plane);
  EXPECT_NEAR((f.map.plane->world_from_plane * (2.5 * on_plane) - expected).norm(), 0, 1e-12);
  EXPECT_NEAR(f.map.plane->extent_m, 2.5 * before.map.plane->extent_m, 1e-12);
}

TEST(Map, DepthIsMeanAndDeviationOfWhatIsMeasured) {
  FabricatedMap f = fabricate_map(3);
  Keyframe& kf = f.map.keyframes.at(f.keyframes[0]);  // at the origin: depth is z
  const double z[3] = {1.0, 2.0, 6.0};
  for (int i = 0; i < 3; ++i) f.map.points.at(f.points[i]).position.z() = z[i];
  f.map.update_depth(&kf);
  EXPECT_NEAR(kf.mean_depth, 3.0, 1e-12);
  EXPECT_NEAR(kf.depth_sigma, std::sqrt((4.0 + 1.0 + 9.0) / 3), 1e-12);
  // A point behind does not count; with fewer than two left the value stays.
  f.map.points.at(f.points[2]).position.z() = -1;
  f.map.update_depth(&kf);
  EXPECT_NEAR(kf.mean_depth, 1.5, 1e-12);
  kf.measurements.clear();
  f.map.update_depth(&kf);
  EXPECT_NEAR(kf.mean_depth, 1.5, 1e-12);
}

TEST(Map, ClearForgetsEverything) {
  FabricatedMap f = fabricate_map();
  f.map.clear();
  EXPECT_TRUE(f.map.empty());
  EXPECT_TRUE(f.map.points.empty());
  EXPECT_FALSE(f.map.plane.has_value());
  EXPECT_SOUND(f.map);
}

TEST(Map, RandomOperationsKeepItSound) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    FabricatedMap f = fabricate_map(24);
    std::mt19937 rng(seed);
    const auto pick = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(rng); };
    for (int i = 0; i < 300; ++i) {
      const PointId p = f.points[pick(f.points.size())], q = f.points[pick(f.points.size())];
      const KeyframeId kf = f.keyframes[pick(f.keyframes.size())];
      if (!f.map.points.contains(p)) continue;
      switch (pick(7)) {
        case 0:
        case 1:
          f.map.add_measurement(kf, {p, {50, 60}, 1.0F, 0, MeasurementSource::refind});
          break;
        case 2:
        case 3:
          f.map.remove_measurement(kf, p);
          break;
        case 4:
          if (!f.map.keyframes.at(kf).find(p)) f.map.mark_failed(kf, p);
          break;
        case 5:
          if (i % 10 == 0 && p != q && f.map.points.contains(q)) f.map.merge_points(p, q);
          break;
        default:
          if (i % 20 == 0) f.map.erase_point(p);
      }
      ASSERT_EQ(joined(check_consistency(f.map, flat_camera())), "") << "seed " << seed << " step " << i;
    }
    EXPECT_GT(f.map.points.size(), 2);
  }
}

}  // namespace
}  // namespace parallax
