#include "map/hit_test.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

CameraModel wide_lens() { return {CameraModelKind::fov, 640, 480, {375.0, 376.0}, {321.4, 238.2}, {0.9}, 1}; }

// A plane through `at` that is turned about x.
Plane tilted(const Vector3d& at, double angle, double extent) {
  return {RigidTransform(exp_so3({angle, 0, 0}), at), extent};
}

TEST(HitTest, RaysGoThroughTheirPixels) {
  const CameraModel camera = wide_lens();
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(0, 1);
  const RigidTransform pose(exp_so3({0.4, -0.3, 1.0}), Vector3d(0.3, -0.2, 0.5));
  for (int i = 0; i < 200; ++i) {
    const Vector2d px(639 * u(random), 479 * u(random));
    const auto ray = pixel_ray(camera, pose, px);
    ASSERT_TRUE(ray);
    EXPECT_NEAR(ray->direction.norm(), 1, 1e-12);
    Vector2d back;
    ASSERT_TRUE(camera.project(pose * ray->at(0.1 + 5 * u(random)), &back));
    EXPECT_LT((back - px).norm(), 1e-6);
  }
  EXPECT_FALSE(pixel_ray(camera, pose, {NAN, 1}));
  const Ray axis = optical_axis(pose);
  EXPECT_LT((pose * axis.at(2) - Vector3d(0, 0, 2)).norm(), 1e-12);
}

TEST(HitTest, PlaneIsHitWhereThePixelSeesIt) {
  const CameraModel camera = wide_lens();
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> u(-1, 1);
  int hits = 0;
  for (int i = 0; i < 300; ++i) {
    const Plane plane = tilted({0.1 * u(random), 0.1 * u(random), 1 + 0.3 * u(random)}, M_PI + 0.8 * u(random), 0.3);
    const RigidTransform pose(exp_so3({0.1 * u(random), 0.1 * u(random), u(random)}), 0.1 * Vector3d::Random());
    // A point of the plane, seen at a pixel: hit exactly there.
    const Vector3d in_plane(0.44 * u(random), 0.44 * u(random), 0), truth = plane.world_from_plane * in_plane;
    Vector2d px;
    if ((pose * truth).z() < 0.1 || !camera.project(pose * truth, &px) || !camera.in_image(px)) continue;
    const auto hit = hit_plane(*pixel_ray(camera, pose, px), {&plane, 1});
    ASSERT_TRUE(hit);
    ++hits;
    EXPECT_LT((hit->position - truth).norm(), 1e-7);
    EXPECT_NEAR(hit->distance_m, (truth - pose.inverse().t).norm(), 1e-7);
    EXPECT_EQ(hit->plane, 0);
    EXPECT_GT(hit->normal.dot(pose.inverse().t - truth), 0) << "the normal is towards the viewer";
    EXPECT_NEAR(std::abs(hit->normal.dot(plane.world_from_plane.R.col(2))), 1, 1e-12);
  }
  EXPECT_GT(hits, 200);
}

TEST(HitTest, OnlyWhatIsInFrontAndWithinTheExtent) {
  const Ray ray{Vector3d::Zero(), Vector3d::UnitZ()};
  const std::vector<Plane> behind{tilted({0, 0, -1}, 0, 0.5)}, beside{tilted({0.8, 0, 1}, 0, 0.5)},
      edge_on{tilted({0, 0, 1}, M_PI / 2, 0.5)};
  EXPECT_FALSE(hit_plane(ray, behind));
  EXPECT_FALSE(hit_plane(ray, beside));
  EXPECT_FALSE(hit_plane(ray, edge_on));
  EXPECT_FALSE(hit_plane(ray, {}));
  HitOptions wide;
  wide.extent_factor = 1.7;
  EXPECT_TRUE(hit_plane(ray, beside, wide));
  // The nearest of several.
  const std::vector<Plane> planes{tilted({0, 0, 2}, 0, 0.5), tilted({0, 0, 1.5}, 0.3, 0.5), tilted({0, 0, 3}, 0, 0.5)};
  const auto hit = hit_plane(ray, planes);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->plane, 1);
  EXPECT_NEAR(hit->distance_m, 1.5, 1e-12);
}

TEST(HitTest, TheDominantPlaneComesFirstAndOnce) {
  TrackingSnapshot map;
  EXPECT_TRUE(planes_of(map).empty());
  map.planes = {tilted({0, 0, 2}, 0, 0.5), tilted({0, 0, 1}, 0, 0.4)};
  map.plane = map.planes[1];
  const auto planes = planes_of(map);
  ASSERT_EQ(planes.size(), 2U);
  EXPECT_EQ(planes[0].extent_m, 0.4);
  EXPECT_EQ(planes[1].extent_m, 0.5);
}

TEST(HitTest, NearestPointOnTheScreen) {
  const test::FabricatedMap f = test::fabricate_map();
  const auto map = make_snapshot(f.map);
  const RigidTransform pose = map->keyframes[1].camera_from_world;
  for (int i = 0; i < map->size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    Vector2d px;
    ASSERT_TRUE(test::flat_camera().project(pose * map->position[row], &px));
    const auto hit = hit_point(test::flat_camera(), pose, px + Vector2d(3, -4), *map);
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->point, map->id[row]);
    EXPECT_EQ(hit->position, map->position[row]);
    EXPECT_EQ(hit->kind, HitKind::point);
    EXPECT_NEAR(hit->normal.norm(), 1, 1e-6);
    HitOptions narrow;
    narrow.point_radius_px = 4.9;
    EXPECT_FALSE(hit_point(test::flat_camera(), pose, px + Vector2d(3, -4), *map, narrow));
  }
  // Points behind the camera are not under any pixel.
  const RigidTransform away(exp_so3({0, M_PI, 0}), Vector3d::Zero());
  for (int x = 0; x < 320; x += 20) EXPECT_FALSE(hit_point(test::flat_camera(), away, {1.0 * x, 100}, *map));
}

TEST(HitTest, OfTwoPointsInOnePlaceTheNearerOne) {
  TrackingSnapshot map;
  for (int i = 0; i < 2; ++i) {
    map.id.push_back({0, i});
    map.position.emplace_back(0, 0, i == 0 ? 2.0 : 1.0);
    for (auto* v : {&map.nx, &map.ny, &map.nz}) v->push_back(0);
  }
  const auto hit = hit_point(test::flat_camera(), {}, {159.5, 119.5}, map);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->point.index, 1);
  EXPECT_LT((hit->normal - Vector3d(0, 0, -1)).norm(), 1e-12) << "without a normal of its own it faces the viewer";
}

TEST(HitTest, PointsInFrontOfThePlaneComeFirst) {
  TrackingSnapshot map;
  map.plane = tilted({0, 0, 1}, M_PI, 0.5);
  const auto add = [&](const Vector3d& p) {
    map.id.push_back({0, map.size()});
    map.position.push_back(p);
    map.nx.push_back(0);
    map.ny.push_back(0);
    map.nz.push_back(-1);
  };
  add({0.001, 0, 0.995});  // on the table
  const CameraModel& camera = test::flat_camera();
  auto hit = hit_test(camera, {}, {159.5, 119.5}, map);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->kind, HitKind::plane) << "a point on the plane is not in front of it";
  EXPECT_LT((hit->position - Vector3d(0, 0, 1)).norm(), 1e-9);
  add({0, 0, 0.8});  // a thing that stands on it
  hit = hit_test(camera, {}, {159.5, 119.5}, map);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->kind, HitKind::point);
  EXPECT_EQ(hit->point.index, 1);
  // Outside the plane a point is hit all the same; elsewhere nothing.
  add({-0.4, 0.3, 0.8});
  Vector2d px;
  ASSERT_TRUE(camera.project(map.position.back(), &px));
  map.plane->extent_m = 0.05;
  hit = hit_test(camera, {}, px, map);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->kind, HitKind::point);
  EXPECT_FALSE(hit_test(camera, {}, {300, 10}, map));
}

}  // namespace
}  // namespace parallax
