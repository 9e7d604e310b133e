// Worlds that do not move as one, and what follows them.
#include "map/world_warp.h"

#include <gtest/gtest.h>

#include "map/content.h"
#include "map/shared_map.h"

namespace parallax {
namespace {

using Eigen::Vector3d;

// Two cameras back to back: the first stays, the second's surroundings are moved.
SimilarityTransform moved() { return {1.25, exp_so3({0, 0.2, 0}), Vector3d(0.3, -0.1, 0.2)}; }

std::shared_ptr<const WorldWarp> back_to_back() {
  const RigidTransform forwards, backwards(exp_so3({0, M_PI, 0}), Vector3d::Zero());
  return std::make_shared<const WorldWarp>(std::vector<WarpNode>{{KeyframeId{0, 2}, forwards, 2, SimilarityTransform()},
                                                                 {KeyframeId{0, 5}, backwards, 2, moved()}});
}

TEST(WorldWarp, APlaceFollowsTheKeyframeThatSeesIt) {
  const auto warp = back_to_back();
  EXPECT_EQ(warp->at({0, 0, 2}).s, 1.0);
  EXPECT_EQ(warp->at({0, 0, -2}).s, 1.25);
  // The keyframe that saw it is known, whatever else is near: itself, the next older, the oldest.
  EXPECT_EQ(warp->at({0, 0, -2}, {0, 2}).s, 1.0);
  EXPECT_EQ(warp->at({0, 0, -2}, {0, 4}).s, 1.0);
  EXPECT_EQ(warp->at({0, 0, 2}, {0, 5}).s, 1.25);
  EXPECT_EQ(warp->at({0, 0, 2}, {0, 9}).s, 1.25);
  EXPECT_EQ(warp->at({0, 0, -2}, {0, 0}).s, 1.0);
}

TEST(WorldWarp, NothingMovesExactlyNot) {
  const SimilarityTransform odd(0.3, exp_so3({0.1, 0.2, 0.3}), Vector3d(1, 2, 3));
  const WorldState state{odd, {back_to_back()}};
  const SimilarityTransform change = state.now_from({odd, 1}, {1, 1, 1});
  EXPECT_EQ(change.s, 1.0);
  EXPECT_EQ(change.t.norm(), 0.0);
}

TEST(WorldWarp, ItIsOfTheWorldThatTheMapHasByThen) {
  // A warp known in a world that had been moved does there what it says.
  const SimilarityTransform world(2, exp_so3({0.3, 0, 0.1}), Vector3d(1, -2, 0.5));
  const RigidTransform camera(exp_so3({0.2, 0.4, 0}), Vector3d(0.1, 0.2, 0.3));
  const auto warp =
      std::make_shared<const WorldWarp>(std::vector<WarpNode>{warp_node({0, 0}, camera, 2, moved(), world)});
  const SimilarityTransform later(0.5, exp_so3({0, 1, 0}), Vector3d(0, 0, 1));
  const Vector3d p(0.4, 0.5, 2);
  const WorldState state{later * world, {warp}};
  EXPECT_LT((state.now_from({world, 0}, p) * p - later * (moved() * p)).norm(), 1e-12);
  // A camera sees afterwards what it saw before.
  const RigidTransform now = state.rebase({world, 0}, camera, {});
  const Vector3d before = camera * p, after = now * (later * (moved() * p));
  EXPECT_LT((before.normalized() - after.normalized()).norm(), 1e-12);
}

TEST(WorldWarp, ContentStaysOnItsSurfaceOnBothSides) {
  SharedMap map;
  Map two;
  for (int i = 0; i < 6; ++i) two.keyframes.insert(Keyframe());
  map.replace_map(two);
  map.publish();
  Content content;
  content.follow(*map.snapshot());
  content.set_seen_from({0, 2});
  const int front = content.add_label("front", {0, 0, 2}, {0, 0, -1});
  content.set_seen_from({0, 5});
  const int back = content.add_model("box", frame_on_surface({0, 0, -2}, {0, 0, 1}), 0.1);
  const int drifted = content.add_label("seen from behind, thought to be in front", {0, 0, 2}, {0, 0, 1});
  SimilarityTransform twice;
  twice.s = 2;
  map.move_world(twice);
  map.warp_world(two,
                 std::make_shared<const WorldWarp>(std::vector<WarpNode>{
                     warp_node({0, 2}, RigidTransform(), 4, SimilarityTransform(), twice),
                     warp_node({0, 5}, RigidTransform(exp_so3({0, M_PI, 0}), Vector3d::Zero()), 4, moved(), twice)}));
  map.publish();
  const auto after = map.snapshot();
  EXPECT_EQ(after->warps.size(), 1U);
  EXPECT_EQ(after->world_version, 2U);
  content.follow(*after);
  content.follow(*after);  // nothing is moved twice
  EXPECT_LT((content.find(front)->position() - Vector3d(0, 0, 4)).norm(), 1e-12);
  EXPECT_LT((content.find(back)->position() - moved() * Vector3d(0, 0, -4)).norm(), 1e-12);
  EXPECT_LT((content.find(drifted)->position() - moved() * Vector3d(0, 0, 4)).norm(), 1e-12);
  EXPECT_NEAR(content.find(back)->world_from_item.s, 2.5, 1e-12) << "it keeps its size on its surface";
  // What is placed afterwards is in the world as it is.
  const int later = content.add_label("later", {0, 0, -2}, {0, 0, 1});
  map.move_world(twice);
  map.publish();
  content.follow(*map.snapshot());
  EXPECT_LT((content.find(later)->position() - Vector3d(0, 0, -4)).norm(), 1e-12);
  EXPECT_LT((content.find(back)->position() - 2 * (moved() * Vector3d(0, 0, -4))).norm(), 1e-12);
  // Another map knows nothing of it.
  map.replace_map({});
  map.publish();
  EXPECT_TRUE(map.snapshot()->warps.empty());
}

}  // namespace
}  // namespace parallax
