#include "mapper/merge_commit.h"

#include <gtest/gtest.h>

#include "mapper/map_join.h"
#include "mapper/map_maintenance.h"
#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

// A map as it was when it had so many keyframes.
Map beginning_of(const Map& map, int keyframes) {
  Map out;
  for (const Keyframe& kf : map.keyframes) {
    if (kf.id.index >= keyframes) continue;
    Keyframe copy = kf;
    copy.measurements.clear();
    out.keyframes.restore(std::move(copy), kf.id);
  }
  for (const MapPoint& p : map.points) {
    if (p.source.index >= keyframes) continue;
    MapPoint copy = p;
    copy.observers.clear();
    out.points.restore(std::move(copy), p.id);
    for (KeyframeId id : p.observers)
      if (id.index < keyframes) out.add_measurement(id, *map.keyframes.at(id).find(p.id));
  }
  return out;
}

// While four views were merged with another session's three, a fifth came. The merged map lies in a world of its own,
// so that where everything has to be is known exactly.
class MergeCommitTest : public ::testing::Test {
 protected:
  static constexpr int kBase = 4;

  MergeCommitTest() : present_(test::true_map(&test::desk_views(), {0, 1, 2, 3, 4}, 60)) {
    present_.planes.push_back({RigidTransform(), 0.3});
    present_.plane = present_.planes.front();
    base_ = beginning_of(present_, kBase);
    base_.planes = present_.planes;
    base_.plane = present_.plane;
    merged_ = join_maps(base_, test::true_map(&test::desk_views(), {5, 6, 7}, 60), {}).map;
    merged_.transform_world(change_);
  }

  MergeCommit commit() const {
    return rebase_merged(present_, world_from_first_, test::small_camera(), base_, merged_);
  }

  const SimilarityTransform change_{1.5, exp_so3({0.1, -0.2, 0.3}), {0.2, -0.1, 0.05}};
  const SimilarityTransform world_from_first_{0.7, exp_so3({-0.3, 0.1, 0.2}), {0.5, 0.4, -0.3}};
  Map present_, base_, merged_;
};

TEST_F(MergeCommitTest, TakesAlongWhatHasComeMeanwhile) {
  const MergeCommit out = commit();
  ASSERT_EQ(out.reason, "");
  EXPECT_EQ(test::faults(out.map, test::small_camera()), "");
  EXPECT_EQ(out.map.keyframes.size(), 8);
  EXPECT_EQ(out.keyframe_shift, 1);
  EXPECT_EQ(out.keyframes_taken_along, 1);
  EXPECT_GT(out.points_taken_along, 5);
  EXPECT_EQ(out.newest.index, 4);
  for (const Keyframe& kf : present_.keyframes) {
    const RigidTransform expected = change_.rebase(kf.camera_from_world);
    const RigidTransform& now = out.map.keyframes.at(kf.id).camera_from_world;
    EXPECT_LT((now.t - expected.t).norm() + (now.R - expected.R).norm(), 1e-8) << kf.id.index;
    EXPECT_EQ(out.map.keyframes.at(kf.id).fixed, kf.fixed);
    // The tracker and what was placed follow, whichever keyframe they are seen from.
    const WorldState world{world_from_first_, {out.warp}};
    const Eigen::Vector3d place = kf.centre();
    EXPECT_LT((world.now_from({world_from_first_, 0}, place, kf.id) * place - change_ * place).norm(), 1e-8);
    EXPECT_LT((world.now_from({world_from_first_, 0}, place) * place - change_ * place).norm(), 1e-8);
  }
  for (const MapPoint& p : present_.points) {
    if (!base_.points.contains(p.id) && p.id.index < base_.points.capacity()) continue;
    const MapPoint* now = out.map.points.find(p.id);
    if (base_.points.contains(p.id) && base_.points.at(p.id).observers.size() < 2) continue;
    ASSERT_NE(now, nullptr) << p.id.index;
    EXPECT_LT((now->position - change_ * p.position).norm(), 1e-8);
    EXPECT_LT((now->normal - change_.R * p.normal).norm(), 1e-8);
    EXPECT_EQ(now->observers, p.observers) << "measured where it was measured, in the fifth view too";
  }
  // The other map's follow, with identifiers that nothing else has.
  for (const Keyframe& kf : merged_.keyframes) {
    if (kf.id.index < kBase) continue;
    const Keyframe& now = out.map.keyframes.at({kf.id.session, kf.id.index + 1});
    EXPECT_EQ(now.frame, kf.frame);
    EXPECT_EQ((now.camera_from_world.t - kf.camera_from_world.t).norm(), 0);
    EXPECT_EQ(now.measurements.size(), kf.measurements.size());
  }
  EXPECT_EQ(out.point_shift, present_.points.capacity() - base_.points.capacity());
  ASSERT_EQ(out.map.planes.size(), 1U);
  EXPECT_LT((out.map.plane->world_from_plane.t - change_.t).norm(), 1e-6);
  EXPECT_NEAR(out.map.plane->extent_m, 0.3 * change_.s, 1e-6);
}

TEST_F(MergeCommitTest, WhatHasGoneMeanwhileStaysGone) {
  const PointId point = present_.points.begin()->id;
  ASSERT_TRUE(merged_.points.contains(point));
  present_.erase_point(point);
  SharedMap shared;
  test::set_map(&shared, present_);
  remove_keyframes(&shared, test::small_camera(), {{0, 2}});
  present_ = test::copy_of(shared);
  const MergeCommit out = commit();
  ASSERT_EQ(out.reason, "");
  EXPECT_EQ(test::faults(out.map, test::small_camera()), "");
  EXPECT_FALSE(out.map.points.contains(point));
  EXPECT_FALSE(out.map.keyframes.contains({0, 2}));
  EXPECT_EQ(out.map.keyframes.size(), 7);
}

TEST_F(MergeCommitTest, IsRefusedWhenLittleOfThePresentMapWasMerged) {
  base_ = beginning_of(present_, 2);
  merged_ = join_maps(base_, test::true_map(&test::desk_views(), {5, 6, 7}, 60), {}).map;
  const MergeCommit out = commit();
  EXPECT_NE(out.reason, "");
  EXPECT_TRUE(out.map.empty());
  present_ = {};
  EXPECT_NE(commit().reason, "");
}

}  // namespace
}  // namespace parallax
