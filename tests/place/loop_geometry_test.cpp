#include "place/loop_geometry.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/error.h"
#include "solver/chi_square.h"
#include "tests/place/made_scenes.h"

namespace parallax {
namespace {

using namespace testing;

const StereoCamera kRig = made_camera();

StereoScene seen_from(const MadeWorld& world, const RigidTransform& world_from_camera, std::mt19937_64* rng) {
  StereoScene scene = made_scene(world, world_from_camera.inverse(), {}, rng);
  build_scene_trees(kRig, {}, &scene);
  return scene;
}

RigidTransform at(double x, double y, double z, double turn) {
  return {exp_so3({0.2 * turn, turn, -0.1 * turn}), {x, y, z}};
}

TEST(LoopGeometry, FindsThePoseWithTheCovarianceOfItsErrors) {
  std::mt19937_64 rng(1);
  double nees = 0;
  int runs = 0;
  for (int i = 0; i < 40; ++i) {
    MadeWorld world;
    add_made_points({-4, -2, 3}, {4, 2, 10}, 500, &rng, &world);
    const RigidTransform found =
        at(made_uniform(-0.7, 0.7, &rng), 0.1, made_uniform(-0.5, 0.5, &rng), made_uniform(-0.25, 0.25, &rng));
    const StereoScene query_scene = seen_from(world, {}, &rng), found_scene = seen_from(world, found, &rng);
    const LoopGeometry loop = check_loop_geometry(kRig, query_scene, kRig, found_scene, {}, {}, &rng);
    ASSERT_TRUE(loop.accepted()) << loop.refused;
    const Vector6d error = (loop.found_from_query * found).log();  // found^-1 is the truth
    EXPECT_LT(error.head<3>().norm(), 0.05);
    EXPECT_LT(error.tail<3>().norm(), 0.01);
    nees += error.dot(loop.covariance.ldlt().solve(error));
    ++runs;
  }
  // Never too sure; at most twice too careful in standard deviation (the floor is for what these scenes lack).
  EXPECT_LT(nees / runs, chi_square_bounds_95(6.0 * runs).high / runs);
  EXPECT_GT(nees / runs, 6.0 / 4);
}

// Two rooms with one kind of floor, each of which has something of its own on the walls.
TEST(LoopGeometry, RepeatedStructureIsNotOnePlace) {
  std::mt19937_64 rng(2);
  constexpr double kAside = 500;  // out of sight
  for (int round = 0; round < 5; ++round) {
    MadeWorld world, floor;
    add_made_points({-3, 0.2, 3}, {3, 2, 8}, 250, &rng, &floor);
    for (const double shift : {0.0, kAside}) {
      for (MadeWorld::Point point : floor.points) {
        point.at.x() += shift;
        world.points.push_back(point);
      }
      add_made_points({-3 + shift, -2, 3}, {3 + shift, 0.1, 8}, 250, &rng, &world);
    }
    const StereoScene here = seen_from(world, {}, &rng);
    const StereoScene other = seen_from(world, at(0.1 + kAside, 0, 0.1, 0.02), &rng);
    const StereoScene again = seen_from(world, at(0.1, 0, 0.1, 0.02), &rng);
    const LoopGeometry alias = check_loop_geometry(kRig, here, kRig, other, {}, {}, &rng);
    EXPECT_NE(alias.refused.find("do not show what they should"), std::string::npos) << alias.refused;
    EXPECT_GE(alias.inliers, 40);  // it is not for want of matches
    EXPECT_TRUE(check_loop_geometry(kRig, here, kRig, again, {}, {}, &rng).accepted());
  }
}

// Two poses explain as much: everything is there twice, a step to the side.
TEST(LoopGeometry, AnotherPoseThatExplainsAsMuchIsARival) {
  std::mt19937_64 rng(3);
  MadeWorld single, twice;
  add_made_points({-2, -1.5, 4}, {2, 1.5, 5}, 220, &rng, &single);
  for (const double shift : {-0.75, 0.75}) {
    for (MadeWorld::Point point : single.points) {
      point.at.x() += shift;
      twice.points.push_back(point);
    }
  }
  const StereoScene query = seen_from(single, {}, &rng), found = seen_from(twice, {}, &rng);
  LoopGeometryOptions options;
  options.ratio = 1;  // lets both through
  const LoopGeometry loop = check_loop_geometry(kRig, query, kRig, found, {}, options, &rng);
  EXPECT_FALSE(loop.accepted());
  EXPECT_NE(loop.refused.find("another pose"), std::string::npos) << loop.refused;
}

TEST(LoopGeometry, OtherPlacesAndEmptyScenesAreRefusedWithAReason) {
  std::mt19937_64 rng(4);
  MadeWorld one, other;
  add_made_points({-3, -2, 3}, {3, 2, 9}, 400, &rng, &one);
  add_made_points({-3, -2, 3}, {3, 2, 9}, 400, &rng, &other);
  const StereoScene here = seen_from(one, {}, &rng), there = seen_from(other, {}, &rng);
  EXPECT_FALSE(check_loop_geometry(kRig, here, kRig, there, {}, {}, &rng).refused.empty());
  EXPECT_FALSE(check_loop_geometry(kRig, here, kRig, {}, {}, {}, &rng).refused.empty());
  EXPECT_FALSE(check_loop_geometry(kRig, {}, kRig, here, {}, {}, &rng).refused.empty());
  LoopGeometryOptions options;
  options.min_seen_share = 2;
  EXPECT_THROW(options.validate(), InputError);
}

}  // namespace
}  // namespace parallax
