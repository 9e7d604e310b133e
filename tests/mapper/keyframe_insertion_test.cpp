#include "mapper/keyframe_insertion.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

class KeyframeInsertionTest : public ::testing::Test {
 protected:
  KeyframeInsertionTest() { test::set_map(&shared_, test::true_map(&desk_views(), {1, 4}, 100)); }

  // View 2 as the tracker offers it: every third point measured, exactly.
  KeyframeProposal proposal() {
    const auto snapshot = shared_.snapshot();
    KeyframeProposal p;
    p.frame = 77;
    p.time = from_seconds(3);
    p.camera_from_world = snapshot->world_from_first.rebase(desk_views().camera_from_world(2));
    p.world_version = snapshot->world_version;
    p.map_version = snapshot->map_version;
    p.world = snapshot->stamp();
    p.images = desk_views().images(2);
    for (std::size_t i = 0; i < snapshot->id.size(); i += 3) {
      Eigen::Vector2d px;
      if (!desk_views().camera().project(p.camera_from_world * snapshot->position[i], &px)) continue;
      if (!desk_views().camera().in_image(px, 10)) continue;
      p.measurements.push_back({snapshot->id[i], px, 1.0F, 0, MeasurementSource::tracker});
    }
    return p;
  }
  std::optional<KeyframeId> insert(const KeyframeProposal& p) {
    const auto id = insert_keyframe(&shared_, desk_views().camera(), MapperOptions(), p);
    EXPECT_EQ(test::faults(shared_, desk_views().camera()), "");
    return id;
  }

  SharedMap shared_;
};

TEST_F(KeyframeInsertionTest, TakesTheTrackersMeasurementsAndMeasuresTheRest) {
  const KeyframeProposal p = proposal();
  ASSERT_GT(p.measurements.size(), 30U);
  const auto id = insert(p);
  ASSERT_TRUE(id);
  const Map map = test::copy_of(shared_);
  const Keyframe& kf = map.keyframes.at(*id);
  EXPECT_EQ(kf.frame, 77);
  EXPECT_EQ(kf.time, from_seconds(3));
  EXPECT_FALSE(kf.fixed);
  EXPECT_EQ(kf.camera_from_world.t, p.camera_from_world.t);
  EXPECT_NEAR(kf.mean_depth, 0.68, 0.1);
  for (const Measurement& m : p.measurements) {
    ASSERT_NE(kf.find(m.point), nullptr);
    EXPECT_EQ(kf.find(m.point)->pixel, m.pixel);
    EXPECT_EQ(kf.find(m.point)->source, MeasurementSource::tracker);
  }
  int refound = 0, right = 0, failed = 0;
  for (const Measurement& m : kf.measurements) {
    if (m.source != MeasurementSource::refind) continue;
    ++refound;
    const auto truth = desk_views().project_visible(2, map.points.at(m.point).position, 0);
    right += truth && (*truth - m.pixel).norm() < level_scale(m.level) ? 1 : 0;
  }
  for (const MapPoint& point : map.points) failed += point.failed.empty() ? 0 : 1;
  EXPECT_GT(refound, 100);
  EXPECT_GT(right, 0.93 * refound);
  EXPECT_LT(failed, 0.3 * refound);
}

TEST_F(KeyframeInsertionTest, AProposalFromAnOldWorldIsMovedIntoTheNew) {
  const KeyframeProposal old = proposal();
  SimilarityTransform total;
  for (const SimilarityTransform& move : {SimilarityTransform(3.0, exp_so3({0.2, 1.0, -0.5}), {1, 2, 3}),
                                          SimilarityTransform(0.4, exp_so3({0, 0, 2.0}), {-1, 0, 0})}) {
    shared_.move_world(move);
    total = move * total;
  }
  shared_.publish();
  const auto id = insert(old);
  ASSERT_TRUE(id);
  const Map map = test::copy_of(shared_);
  const RigidTransform expected = total.rebase(desk_views().camera_from_world(2));
  EXPECT_NEAR((map.keyframes.at(*id).camera_from_world.R - expected.R).norm(), 0, 1e-9);
  EXPECT_NEAR((map.keyframes.at(*id).camera_from_world.t - expected.t).norm(), 0, 1e-9);
  EXPECT_LT(test::reprojection_rms(map, desk_views().camera()), 1.0);
}

TEST_F(KeyframeInsertionTest, AProposalFromAnOldMapIsRefused) {
  const KeyframeProposal old = proposal();
  shared_.replace_map(shared_.copy().map);
  shared_.publish();
  EXPECT_FALSE(insert(old));
  EXPECT_EQ(test::copy_of(shared_).keyframes.size(), 2);
  EXPECT_TRUE(insert(proposal()));
}

TEST_F(KeyframeInsertionTest, OneThatMeasuresTooLittleIsRefused) {
  KeyframeProposal p = proposal();
  p.measurements.resize(static_cast<std::size_t>(MapperOptions().min_keyframe_measurements) - 1);
  EXPECT_FALSE(insert(p));
  EXPECT_EQ(test::copy_of(shared_).keyframes.size(), 2);
}

TEST_F(KeyframeInsertionTest, PointsErasedMeanwhileAreLeftOut) {
  const KeyframeProposal p = proposal();
  shared_.write([&](Map& m) {
    for (std::size_t i = 0; i < p.measurements.size(); i += 4) m.erase_point(p.measurements[i].point);
  });
  const auto id = insert(p);
  ASSERT_TRUE(id);
  const Map map = test::copy_of(shared_);
  EXPECT_EQ(map.keyframes.at(*id).find(p.measurements[0].point), nullptr);
  EXPECT_NE(map.keyframes.at(*id).find(p.measurements[1].point), nullptr);
}

TEST_F(KeyframeInsertionTest, NoMapTakesNone) {
  const KeyframeProposal p = proposal();
  SharedMap empty;
  EXPECT_FALSE(insert_keyframe(&empty, desk_views().camera(), MapperOptions(), p));
}

}  // namespace
}  // namespace parallax
