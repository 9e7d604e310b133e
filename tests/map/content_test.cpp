#include "map/content.h"

#include <gtest/gtest.h>

#include "core/check.h"
#include "map/shared_map.h"
#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using Eigen::Vector3d;

SimilarityTransform some_change(double scale) { return {scale, exp_so3({0.2, -0.4, 0.9}), Vector3d(0.3, -0.7, 0.2)}; }

TEST(Content, StandsOnItsSurface) {
  for (const Vector3d& normal : {Vector3d(0, 0, 1), Vector3d(0, 0, -2), Vector3d(1, 0, 0), Vector3d(0.3, -0.5, 0.1)}) {
    const RigidTransform T = frame_on_surface({1, 2, 3}, normal);
    EXPECT_LT((T.R * T.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(T.R.determinant(), 1, 1e-12);
    EXPECT_LT((T.R.col(2) - normal.normalized()).norm(), 1e-12);
    EXPECT_EQ(T.t, Vector3d(1, 2, 3));
  }
  // x goes where it is asked to go, as far as the surface allows.
  const RigidTransform T = frame_on_surface(Vector3d::Zero(), Vector3d::UnitZ(), {1, 1, 5});
  EXPECT_LT((T.R.col(0) - Vector3d(1, 1, 0).normalized()).norm(), 1e-12);
  EXPECT_THROW(frame_on_surface(Vector3d::Zero(), Vector3d::Zero()), CheckFailure);
}

TEST(Content, ItemsAreAddedRenamedAndErased) {
  Content content;
  const int label = content.add_label("cup", {0.1, 0.2, 0}, Vector3d::UnitZ());
  const int model = content.add_model("cube", frame_on_surface({0, 0, 0}, Vector3d::UnitZ()), 0.08);
  const int line = content.add_line({0, 0, 0}, {0.3, 0.4, 0});
  ASSERT_EQ(content.items().size(), 3U);
  EXPECT_EQ(content.items()[0].id, label);
  EXPECT_NEAR(content.find(line)->length_m(), 0.5, 1e-12);
  EXPECT_LT((content.find(line)->line_end() - Vector3d(0.3, 0.4, 0)).norm(), 1e-12);
  EXPECT_TRUE(content.rename(label, "mug"));
  EXPECT_EQ(content.find(label)->text, "mug");
  EXPECT_TRUE(content.resize(model, 0.2));
  EXPECT_FALSE(content.resize(label, 0.2));
  EXPECT_EQ(content.find(model)->size_m, 0.2);
  EXPECT_TRUE(content.erase(model));
  EXPECT_FALSE(content.erase(model));
  EXPECT_FALSE(content.move(model, Vector3d::Zero()));
  EXPECT_EQ(content.find(model), nullptr);
  ASSERT_EQ(content.items().size(), 2U);
  EXPECT_GT(content.add_label("next", {0, 0, 0}, Vector3d::UnitZ()), line) << "identifiers are never reused";
  EXPECT_THROW(content.add_label("nowhere", {NAN, 0, 0}, Vector3d::UnitZ()), CheckFailure);
  content.clear();
  EXPECT_TRUE(content.items().empty());
}

// What is placed stays where it is in the picture when the world moves under it.
TEST(Content, FollowsTheWorldWithoutAJump) {
  const CameraModel& camera = test::flat_camera();
  const RigidTransform camera_from_old(exp_so3({0.1, 0.2, 0.0}), Vector3d(0, 0, 1));
  Content content;
  const int line = content.add_line({0.05, -0.04, 0}, {-0.1, 0.08, 0.02});
  const int model = content.add_model("cube", frame_on_surface({0.1, 0, 0}, {0.1, 0.2, 1}), 0.06);
  const ContentItem line_before = *content.find(line), model_before = *content.find(model);

  // Two changes, one after the other, as the snapshot tells them: their product.
  SimilarityTransform world_from_first;
  for (int i = 0; i < 50; ++i) {
    const SimilarityTransform change = some_change(i % 2 == 0 ? 1.7 : 0.6);
    world_from_first = change * world_from_first;
    content.follow(0, world_from_first);
  }
  const RigidTransform camera_from_new = world_from_first.rebase(camera_from_old);
  const auto pixel = [&](const RigidTransform& pose, const Vector3d& p) {
    Eigen::Vector2d px(-1, -1);
    EXPECT_TRUE(camera.project(pose * p, &px));
    return px;
  };
  const ContentItem line_after = *content.find(line), model_after = *content.find(model);
  EXPECT_LT((pixel(camera_from_old, line_before.position()) - pixel(camera_from_new, line_after.position())).norm(),
            1e-6);
  EXPECT_LT((pixel(camera_from_old, line_before.line_end()) - pixel(camera_from_new, line_after.line_end())).norm(),
            1e-6);
  const Vector3d corner(0.03, 0.03, 0.06);  // of the model, in its frame: its size is carried along
  EXPECT_LT((pixel(camera_from_old, model_before.world_from_item * corner) -
             pixel(camera_from_new, model_after.world_from_item * corner))
                .norm(),
            1e-6);
  EXPECT_EQ(model_after.size_m, 0.06);
  // A measured line has the length of the present scale.
  EXPECT_NEAR(line_after.length_m(), world_from_first.s * line_before.length_m(), 1e-9);

  // Moved in the new world, it stays there when the world moves on.
  content.move(model, Vector3d(0.5, 0.6, 0.7));
  const SimilarityTransform change = some_change(2.0);
  content.follow(0, change * world_from_first);
  EXPECT_LT((content.find(model)->position() - change * Vector3d(0.5, 0.6, 0.7)).norm(), 1e-9);
  EXPECT_NEAR(content.find(model)->world_from_item.s, 2.0 * world_from_first.s, 1e-9);
}

TEST(Content, FollowsASharedMap) {
  SharedMap map;
  test::FabricatedMap f = test::fabricate_map();
  map.replace_map(f.map);
  map.publish();
  Content content;
  content.follow(*map.snapshot());
  const Vector3d on_point = map.snapshot()->position[3];
  const int id = content.add_label("here", on_point, Vector3d::UnitZ());
  const SimilarityTransform change = some_change(3.0);
  map.move_world(change);
  map.publish();
  content.follow(*map.snapshot());
  EXPECT_LT((content.find(id)->position() - map.snapshot()->position[3]).norm(), 1e-12);
}

TEST(Content, IsParkedWhenTheMapIsMadeAnew) {
  Content content;
  content.follow(1, SimilarityTransform());
  const int first = content.add_label("a", {0, 0, 0}, Vector3d::UnitZ());
  content.follow(2, some_change(2));
  EXPECT_TRUE(content.items().empty());
  EXPECT_EQ(content.parked(), 1);
  EXPECT_EQ(content.find(first), nullptr);
  EXPECT_FALSE(content.rename(first, "b"));
  const int second = content.add_label("c", {1, 0, 0}, Vector3d::UnitZ());
  content.follow(1, some_change(3));
  ASSERT_EQ(content.items().size(), 1U);
  EXPECT_EQ(content.items()[0].id, first);
  EXPECT_LT((content.items()[0].position() - some_change(3) * Vector3d::Zero()).norm(), 1e-12);
  EXPECT_EQ(content.parked(), 1);
  content.clear_parked();
  content.follow(2, SimilarityTransform());
  EXPECT_EQ(content.find(second), nullptr);
}

// What was saved in a world is put back in it; new items get numbers of their own.
TEST(Content, IsRestored) {
  Content first;
  const int label = first.add_label("cup", {1, 2, 3}, {0, 0, 1});
  first.add_model("tower", RigidTransform(exp_so3({0, 0, 1}), {0, 1, 0}), 0.2);
  first.erase(label);
  first.add_line({0, 0, 0}, {1, 0, 0}, "edge");
  Content second;
  second.follow(3, SimilarityTransform(2, exp_so3({0.1, 0, 0}), {0, 0, 5}));
  second.restore(first.items());
  ASSERT_EQ(second.items().size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(second.items()[i].id, first.items()[i].id);
    EXPECT_EQ(second.items()[i].text, first.items()[i].text);
    EXPECT_EQ(second.items()[i].world_from_item.t, first.items()[i].world_from_item.t);
    EXPECT_EQ(second.items()[i].size_m, first.items()[i].size_m);
    EXPECT_EQ(second.items()[i].end_in_item, first.items()[i].end_in_item);
  }
  const int added = second.add_label("new", {0, 0, 0}, {0, 0, 1});
  EXPECT_GT(added, first.items().back().id);
  // They follow the world as all content does.
  second.follow(3, SimilarityTransform(4, exp_so3({0.1, 0, 0}), {0, 0, 5}));
  EXPECT_NEAR(second.items()[0].world_from_item.s, 2, 1e-12);
}

}  // namespace
}  // namespace parallax
