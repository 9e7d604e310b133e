#include "app/map_view.h"

#include <gtest/gtest.h>

#include "render/synthetic_path.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kWidth = 800, kHeight = 600;

Vector2d project(const OrbitCamera& camera, const Vector3d& p) {
  Vector2d px(-1e6, -1e6);
  EXPECT_TRUE(orbit_lens(kWidth, kHeight).project(camera.camera_from_world() * p, &px));
  return px;
}

// Five keyframes in a row, half a metre before a table with points.
TrackingSnapshot table() {
  TrackingSnapshot map;
  for (int i = 0; i < 5; ++i) {
    SnapshotKeyframe kf;
    kf.id = {0, 2 * i};
    const RigidTransform world_from_camera = look_at({0.15 * i - 0.3, -0.4, 0.3}, {0.15 * i - 0.3, 0, 0});
    kf.camera_from_world = world_from_camera.inverse();
    kf.centre = world_from_camera.t;
    kf.mean_depth = 0.5;
    map.keyframes.push_back(kf);
  }
  for (int i = 0; i < 100; ++i) {
    map.id.push_back({0, i});
    map.position.emplace_back(0.06 * (i % 10) - 0.27, 0.04 * (i / 10) - 0.18, 0);
    map.source_level.push_back(static_cast<std::uint8_t>(i % 4));
  }
  map.plane = Plane{};
  return map;
}

PointerInput at(double x, double y) {
  PointerInput out;
  out.x = x;
  out.y = y;
  return out;
}

TEST(OrbitCamera, LooksAtItsTargetWithTheSkyAbove) {
  for (const double yaw : {-2.0, 0.0, 1.0, 3.0}) {
    for (const double pitch : {-1.2, 0.0, 0.6, 1.5}) {
      const OrbitCamera camera{{0.1, -0.2, 0.3}, yaw, pitch, 0.8, false};
      const RigidTransform T = camera.camera_from_world();
      EXPECT_NEAR(T.R.determinant(), 1, 1e-9);
      EXPECT_LT((T.R * T.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
      EXPECT_LT((T * camera.target - Vector3d(0, 0, 0.8)).norm(), 1e-9);
      EXPECT_LT((T * camera.eye()).norm(), 1e-9);
      const Vector3d up = T.R * Vector3d::UnitZ();
      EXPECT_NEAR(up.x(), 0, 1e-9);
      EXPECT_LT(up.y(), 0) << "up in the world is up on the screen";
    }
  }
}

TEST(OrbitControl, LeftDragTurnsWithThePointer) {
  OrbitControl control;
  control.camera.yaw = -1.5;
  const OrbitCamera before = control.camera;
  const Vector3d near_side = before.eye() + 0.5 * (before.target - before.eye()) + Vector3d(0, 0, 0.05);
  PointerInput pointer = at(400, 300);
  pointer.left = true;
  EXPECT_FALSE(control.update(pointer, kHeight));
  EXPECT_EQ(control.camera.yaw, before.yaw) << "a press alone moves nothing";
  pointer.x += 60;
  pointer.y += 30;
  EXPECT_FALSE(control.update(pointer, kHeight));
  EXPECT_EQ(control.camera.target, before.target);
  EXPECT_EQ(control.camera.distance, before.distance);
  // What is nearer than the target follows the pointer.
  EXPECT_GT(project(control.camera, near_side).x(), project(before, near_side).x());
  EXPECT_GT(project(control.camera, near_side).y(), project(before, near_side).y());
  pointer.left = false;
  EXPECT_FALSE(control.update(pointer, kHeight)) << "a drag is no click";
  const double yaw = control.camera.yaw;
  control.update(at(10, 10), kHeight);
  EXPECT_EQ(control.camera.yaw, yaw) << "without a button nothing moves";
  // Never over the top.
  pointer.left = true;
  control.update(pointer, kHeight);
  pointer.y += 10000;
  control.update(pointer, kHeight);
  EXPECT_LT(control.camera.pitch, M_PI / 2);
}

TEST(OrbitControl, PanKeepsTheTargetUnderThePointer) {
  for (const int how : {0, 1, 2}) {
    OrbitControl control;
    const Vector3d held = control.camera.target;
    PointerInput pointer = at(kWidth / 2.0, kHeight / 2.0);
    pointer.middle = how == 0;
    pointer.right = how == 1;
    pointer.left = pointer.shift = how == 2;
    control.update(pointer, kHeight);
    const Vector2d before = project(control.camera, held);
    for (int step = 0; step < 4; ++step) {
      pointer.x += 30;
      pointer.y -= 20;
      control.update(pointer, kHeight);
    }
    EXPECT_LT((project(control.camera, held) - before - Vector2d(120, -80)).norm(), 1e-6);
  }
}

TEST(OrbitControl, WheelZoomsWithinLimits) {
  OrbitControl control;
  PointerInput pointer = at(10, 10);
  pointer.scroll = 2;
  control.update(pointer, kHeight);
  EXPECT_LT(control.camera.distance, 1);
  pointer.scroll = -2;
  control.update(pointer, kHeight);
  EXPECT_NEAR(control.camera.distance, 1, 1e-12);
  pointer.scroll = 1000;
  control.update(pointer, kHeight);
  EXPECT_GT(control.camera.distance, 0);
  pointer.scroll = -100000;
  control.update(pointer, kHeight);
  EXPECT_TRUE(std::isfinite(control.camera.distance));
}

TEST(OrbitControl, AClickIsAPressAndReleaseInOnePlace) {
  OrbitControl control;
  PointerInput pointer = at(100, 200);
  pointer.left = true;
  EXPECT_FALSE(control.update(pointer, kHeight));
  pointer.x += 2;  // a hand that trembles
  EXPECT_FALSE(control.update(pointer, kHeight));
  pointer.left = false;
  const auto click = control.update(pointer, kHeight);
  ASSERT_TRUE(click);
  EXPECT_EQ(*click, Vector2d(100, 200));
  EXPECT_FALSE(control.update(pointer, kHeight)) << "once";
  // A press that came from elsewhere is none.
  pointer.left = true;
  control.update(pointer, kHeight);
  control.release();
  pointer.left = false;
  EXPECT_FALSE(control.update(pointer, kHeight));
  // Nor is the middle button.
  pointer.middle = true;
  control.update(pointer, kHeight);
  pointer.middle = false;
  EXPECT_FALSE(control.update(pointer, kHeight));
}

TEST(MapView, FitsTheMapAndLooksFromBehindTheKeyframes) {
  const TrackingSnapshot map = table();
  OrbitCamera camera = fit_to_map(map, {});
  int inside = 0;
  for (const Vector3d& p : map.position) inside += orbit_lens(kWidth, kHeight).in_image(project(camera, p));
  EXPECT_GE(inside, 80);
  for (const auto& kf : map.keyframes)
    EXPECT_TRUE(orbit_lens(kWidth, kHeight).in_image(project(camera, kf.centre))) << kf.id.index;
  // The keyframes are on y < 0 and look along y: so does the view.
  EXPECT_LT(camera.eye().y(), camera.target.y());
  // A direction that was chosen is kept.
  camera.turned = true;
  camera.yaw = 1.234;
  EXPECT_EQ(fit_to_map(map, camera).yaw, 1.234);
  EXPECT_EQ(fit_to_map(TrackingSnapshot(), camera).distance, camera.distance);
}

TEST(MapView, DrawsEverythingThereIs) {
  const TrackingSnapshot map = table();
  TrackingResult tracked;
  tracked.camera_from_world = map.keyframes[1].camera_from_world;
  MapViewInput input;
  input.map = &map;
  const OrbitCamera camera = fit_to_map(map, {});
  const DrawList bare = map_view(input, camera, kWidth, kHeight);
  EXPECT_EQ(bare.world_points.size(), map.position.size());
  EXPECT_EQ(bare.grids.size(), 1U);
  EXPECT_EQ(bare.camera.width(), kWidth);
  ASSERT_TRUE(bare.camera_from_world);
  input.tracked = &tracked;
  const DrawList with_camera = map_view(input, camera, kWidth, kHeight);
  EXPECT_GT(with_camera.world_lines.size(), bare.world_lines.size());
  tracked.map_version = 9;
  EXPECT_EQ(map_view(input, camera, kWidth, kHeight).world_lines.size(), bare.world_lines.size())
      << "a pose on another map is not drawn";
  // The selected keyframe looks different.
  input.tracked = nullptr;
  input.selected = map.keyframes[2].id;
  const DrawList selected = map_view(input, camera, kWidth, kHeight);
  int changed = 0;
  for (std::size_t i = 0; i < bare.world_lines.size(); ++i)
    changed += selected.world_lines[i].width_px != bare.world_lines[i].width_px;
  EXPECT_EQ(changed, 10);
  EXPECT_EQ(find_keyframe(map, map.keyframes[3].id), &map.keyframes[3]);
  EXPECT_EQ(find_keyframe(map, {0, 1}), nullptr);
}

TEST(MapView, PicksTheKeyframeUnderTheClick) {
  const TrackingSnapshot map = table();
  MapViewInput input;
  input.map = &map;
  const OrbitCamera camera = fit_to_map(map, {});
  for (const auto& kf : map.keyframes) {
    const auto picked =
        pick_keyframe(input, camera, kWidth, kHeight, project(camera, kf.centre) + Vector2d(0.5, -0.5), 3);
    ASSERT_TRUE(picked);
    EXPECT_EQ(*picked, kf.id);
  }
  EXPECT_FALSE(pick_keyframe(input, camera, kWidth, kHeight, {5, 5}));
  // One behind the other: the nearer one is taken.
  TrackingSnapshot pair = map;
  pair.keyframes.resize(2);
  OrbitCamera along;
  along.target = pair.keyframes[1].centre;
  along.yaw = M_PI;  // from -x, along the row
  along.pitch = 0;
  along.distance = 1;
  input.map = &pair;
  const auto picked = pick_keyframe(input, along, kWidth, kHeight, project(along, pair.keyframes[1].centre));
  ASSERT_TRUE(picked);
  EXPECT_EQ(*picked, pair.keyframes[0].id);
}

TEST(CameraPath, FollowsTheWorldAndForgetsTheOldMap) {
  CameraPath path;
  TrackingResult tracked;
  tracked.map_version = 1;
  const auto add = [&](const Vector3d& centre) {
    tracked.camera_from_world = RigidTransform(Eigen::Matrix3d::Identity(), -centre);
    path.add(tracked);
  };
  for (int i = 0; i < 10; ++i) add({0.1 * i, 0, 0});
  add({0.9, 0, 0});  // it has not moved
  EXPECT_EQ(path.size(), 10);
  tracked.camera_from_world.reset();
  path.add(tracked);  // lost
  add({2, 0, 0});
  const SimilarityTransform change(2, exp_so3({0, 0, M_PI / 2}), Vector3d(0, 0, 1));
  const auto pieces = path.pieces(change);
  ASSERT_EQ(pieces.size(), 2U);
  ASSERT_EQ(pieces[0].size(), 10U);
  EXPECT_LT((pieces[0][3] - Vector3d(0, 0.6, 1)).norm(), 1e-9);
  EXPECT_LT((pieces[1][0] - Vector3d(0, 4, 1)).norm(), 1e-9);
  // Places told in the new world join the old ones.
  tracked.world_from_first = change;
  add(change * Vector3d(2.5, 0, 0));
  EXPECT_LT((path.pieces(SimilarityTransform())[1].back() - Vector3d(2.5, 0, 0)).norm(), 1e-9);
  tracked.map_version = 2;
  add({0, 0, 0});
  EXPECT_EQ(path.size(), 1);
}

TEST(CameraPath, MemoryIsBounded) {
  CameraPath path(64);
  TrackingResult tracked;
  for (int i = 0; i < 10000; ++i) {
    tracked.camera_from_world = RigidTransform(Eigen::Matrix3d::Identity(), Vector3d(-0.01 * i, 0, 0));
    path.add(tracked);
    ASSERT_LE(path.size(), 64);
  }
  const auto pieces = path.pieces(SimilarityTransform());
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_NEAR(pieces[0].front().x(), 0, 1e-9) << "the beginning is kept";
  EXPECT_GT(pieces[0].back().x(), 90) << "and so is the present";
  EXPECT_GT(pieces[0].size(), 20U);
  for (std::size_t i = 1; i < pieces[0].size(); ++i) EXPECT_GT(pieces[0][i].x(), pieces[0][i - 1].x());
}

}  // namespace
}  // namespace parallax
