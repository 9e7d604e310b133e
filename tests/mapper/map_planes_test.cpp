// The planes of a map: found again, picked, and settled as the map grows.
#include "mapper/map_planes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

// A table at z = 0 with a wide book of 2 cm on it and a wall at y = 0.5, seen by so many keyframes; heights with noise.
Map room(int keyframes, double noise_m) {
  Map map;
  for (int i = 0; i < keyframes; ++i) {
    Keyframe kf;
    // Looks straight down from 60 cm.
    kf.camera_from_world.R << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    kf.camera_from_world.t = -(kf.camera_from_world.R * Eigen::Vector3d(0.02 * i, 0, 0.6));
    map.keyframes.insert(kf);
  }
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> side(-0.3, 0.3);
  std::normal_distribution<double> noise(0, noise_m);
  const auto add = [&](double x, double y, double z) {
    MapPoint p;
    p.position = {x, y, z};
    p.source = {0, 0};
    map.points.insert(p);
  };
  for (int i = 0; i < 300; ++i) add(side(rng), side(rng), noise(rng));
  for (int i = 0; i < 200; ++i) add(0.15 + 0.5 * std::abs(side(rng)), side(rng), 0.02 + noise(rng));
  for (int i = 0; i < 120; ++i) add(side(rng), 0.5 + noise(rng), 0.3 + side(rng));
  return map;
}

void expect_plane(const Plane& plane, const Eigen::Vector3d& normal, double offset, double angle_deg, double off_m) {
  const Eigen::Vector3d found = plane.world_from_plane.R.col(2);
  EXPECT_LT(std::acos(std::min(1.0, found.dot(normal))) * 180 / M_PI, angle_deg);
  EXPECT_NEAR(normal.dot(plane.world_from_plane.t), offset, off_m);
  EXPECT_GT(plane.extent_m, 0.05);
  EXPECT_LT(plane.extent_m, 1.0);
}

TEST(MapPlanes, TheTableIsToldFromWhatLiesOnIt) {
  SharedMap shared;
  test::set_map(&shared, room(6, 0.001));
  std::mt19937_64 rng(1);
  ASSERT_TRUE(detect_plane(&shared, MapperOptions(), &rng).ok);
  const Map map = test::copy_of(shared);
  expect_plane(*map.plane, Eigen::Vector3d::UnitZ(), 0, 0.2, 0.001);
  ASSERT_EQ(map.planes.size(), 1U);
  EXPECT_EQ(map.planes[0].world_from_plane.t, map.plane->world_from_plane.t);
  // Again: it takes its own place.
  ASSERT_TRUE(detect_plane(&shared, MapperOptions(), &rng).ok);
  EXPECT_EQ(test::copy_of(shared).planes.size(), 1U);
}

TEST(MapPlanes, ARefinementSettlesWithoutTurningOrSliding) {
  SharedMap shared;
  Map map = room(6, 0.001);
  Plane before;
  before.world_from_plane = RigidTransform(exp_so3({0.05, -0.04, 0.7}), {0.03, -0.05, 0.02});
  map.plane = before;
  map.planes = {before};
  test::set_map(&shared, map);
  std::mt19937_64 rng(1);
  ASSERT_TRUE(refine_dominant_plane(&shared, MapperOptions(), &rng));
  const Plane plane = *test::copy_of(shared).plane;
  expect_plane(plane, Eigen::Vector3d::UnitZ(), 0, 0.2, 0.001);
  EXPECT_LT((plane.world_from_plane.t - before.world_from_plane.t).norm(), 0.025) << "straight down onto the table";
  EXPECT_GT(plane.world_from_plane.R.col(0).dot(before.world_from_plane.R.col(0)), 0.99);
  EXPECT_NEAR(plane.world_from_plane.R.determinant(), 1, 1e-12);
  EXPECT_EQ(test::copy_of(shared).planes.size(), 1U);
}

TEST(MapPlanes, APickedPlaneIsAddedAndDominant) {
  SharedMap shared;
  test::set_map(&shared, room(6, 0.001));
  std::mt19937_64 rng(1);
  ASSERT_TRUE(detect_plane(&shared, MapperOptions(), &rng).ok);
  const Eigen::Vector3d on_wall(0.05, 0.5, 0.3);
  ASSERT_TRUE(add_plane(&shared, MapperOptions(), on_wall, &rng).ok);
  Map map = test::copy_of(shared);
  ASSERT_EQ(map.planes.size(), 2U);
  expect_plane(*map.plane, -Eigen::Vector3d::UnitY(), -0.5, 1.0, 0.003);
  EXPECT_LT((map.plane->world_from_plane.t - on_wall).norm(), 0.005) << "centred on what was picked";
  expect_plane(map.planes[0], Eigen::Vector3d::UnitZ(), 0, 0.2, 0.001);
  // The same again is the same plane, the book another one.
  ASSERT_TRUE(add_plane(&shared, MapperOptions(), on_wall + Eigen::Vector3d(0.05, 0, 0), &rng).ok);
  EXPECT_EQ(test::copy_of(shared).planes.size(), 2U);
  // Moved with the world.
  SimilarityTransform twice;
  twice.s = 2;
  shared.write([&](Map& m) { m.transform_world(twice); });
  map = test::copy_of(shared);
  EXPECT_NEAR(map.planes[1].world_from_plane.t.y(), 1.0, 0.01);
  EXPECT_EQ(map.planes[1].extent_m, map.plane->extent_m);
  shared.publish();
  EXPECT_EQ(shared.snapshot()->planes.size(), 2U);
}

TEST(MapPlanes, RefusalsSayWhy) {
  SharedMap shared;
  std::mt19937_64 rng(1);
  EXPECT_EQ(detect_plane(&shared, MapperOptions(), &rng).reason, "there is no map yet");
  EXPECT_EQ(add_plane(&shared, MapperOptions(), {0, 0, 0}, &rng).reason, "there is no map yet");
  test::set_map(&shared, room(6, 0.001));
  EXPECT_NE(add_plane(&shared, MapperOptions(), {5, 5, 5}, &rng).reason.find("too few points"), std::string::npos);
  EXPECT_FALSE(add_plane(&shared, MapperOptions(), {NAN, 0, 0}, &rng).ok);
  EXPECT_FALSE(add_plane(&shared, MapperOptions(), {0, 0, 0.3}, &rng).ok) << "in the air";
  EXPECT_TRUE(test::copy_of(shared).planes.empty());
}

}  // namespace
}  // namespace parallax
