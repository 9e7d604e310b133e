#include "mapper/data_association.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

class DataAssociationTest : public ::testing::Test {
 protected:
  DataAssociationTest() : association_(desk_views().camera(), MapperOptions()) {
    test::set_map(&shared_, test::true_map(&desk_views(), {1, 3, 5}, 40));
  }

  int refine(int max_points = 10000, std::stop_token stop = {}) {
    idle_ = false;
    const int added = association_.refine(&shared_, max_points, stop, &idle_);
    EXPECT_EQ(test::faults(shared_, desk_views().camera()), "");
    return added;
  }
  // As when an adjustment has thrown the measurement out.
  void throw_out(KeyframeId kf, PointId p) {
    ASSERT_TRUE(shared_.write([&](Map& m) { return m.remove_measurement(kf, p); }));
    association_.add_outliers({{kf, p}});
  }
  void finish() {
    while (!idle_) refine();
  }
  // Points of the first keyframe that all three see and that level 0 measures well.
  std::vector<PointId> well_seen(std::size_t n) {
    std::vector<PointId> out;
    for (const MapPoint& p : test::copy_of(shared_).points)
      if (p.source == KeyframeId{0, 0} && p.observers.size() == 3 && p.source_level < 2 && out.size() < n)
        out.push_back(p.id);
    EXPECT_EQ(out.size(), n);
    return out;
  }

  SharedMap shared_;
  DataAssociation association_;
  bool idle_ = false;
};

TEST_F(DataAssociationTest, NewPointsAreMeasuredInOldKeyframes) {
  // The points of the newest keyframe were made with one other view only.
  int removed = 0;
  shared_.write([&](Map& m) {
    for (MapPoint& p : m.points) {
      p.refined_everywhere = p.source != KeyframeId{0, 2};
      if (!p.refined_everywhere) removed += m.remove_measurement({0, 0}, p.id) ? 1 : 0;
    }
  });
  ASSERT_GT(removed, 20);
  const int added = refine();
  const Map map = test::copy_of(shared_);
  EXPECT_GT(added, 0.7 * removed);
  int right = 0, refound = 0;
  for (const Measurement& m : map.keyframes.at({0, 0}).measurements) {
    if (map.points.at(m.point).source != KeyframeId{0, 2}) continue;
    ++refound;
    EXPECT_EQ(m.source, MeasurementSource::refind);
    const auto truth = desk_views().project_visible(1, map.points.at(m.point).position, 0);
    right += truth && (*truth - m.pixel).norm() < level_scale(m.level) ? 1 : 0;
  }
  EXPECT_GT(right, 0.9 * refound);
  for (const MapPoint& p : map.points) EXPECT_TRUE(p.refined_everywhere);
  EXPECT_EQ(refine(), 0);
  EXPECT_TRUE(idle_) << "every point has been looked at";
}

TEST_F(DataAssociationTest, WorksInBatches) {
  refine(10);
  EXPECT_FALSE(idle_);
  int done = 0;
  for (const MapPoint& p : test::copy_of(shared_).points) done += p.refined_everywhere ? 1 : 0;
  EXPECT_EQ(done, 10);
  std::stop_source stop;
  stop.request_stop();
  refine(10, stop.get_token());
  EXPECT_FALSE(idle_);
  int later = 0;
  for (const MapPoint& p : test::copy_of(shared_).points) later += p.refined_everywhere ? 1 : 0;
  EXPECT_EQ(later, done) << "stopped before it began";
}

TEST_F(DataAssociationTest, AnOutlierGetsASecondChance) {
  finish();
  for (PointId p : well_seen(8)) throw_out({0, 1}, p);
  EXPECT_GE(refine(), 6);
  const Map map = test::copy_of(shared_);
  for (PointId p : well_seen(6)) {
    const Measurement* m = map.keyframes.at({0, 1}).find(p);
    if (!m || m->source != MeasurementSource::second_chance) continue;
    const auto truth = desk_views().project_visible(3, map.points.at(p).position, 0);
    ASSERT_TRUE(truth);
    EXPECT_LT((*truth - m->pixel).norm(), 2.0 * level_scale(m->level)) << "far tighter";
  }
}

TEST_F(DataAssociationTest, AndNoThird) {
  finish();
  const PointId p = well_seen(8)[5];
  throw_out({0, 1}, p);
  if (refine() == 1) {
    throw_out({0, 1}, p);
    EXPECT_EQ(refine(), 0) << "each pair is tried once only";
  }
  EXPECT_EQ(test::copy_of(shared_).keyframes.at({0, 1}).find(p), nullptr);
  association_.clear();  // another map
}

TEST_F(DataAssociationTest, WhatFailsIsMarkedSo) {
  finish();
  const PointId p = well_seen(1)[0];
  // The keyframe shows something else now: the patch cannot be found.
  shared_.write([&](Map& m) {
    m.keyframes.at({0, 1}).images = test::features_of(GreyImage(240, 320, static_cast<std::uint8_t>(90)));
  });
  throw_out({0, 1}, p);
  EXPECT_EQ(refine(), 0);
  EXPECT_EQ(test::copy_of(shared_).points.at(p).failed, (std::vector<KeyframeId>{{0, 1}}));
}

TEST_F(DataAssociationTest, WhatIsGoneIsLeftAlone) {
  finish();
  const std::vector<PointId> points = well_seen(2);
  throw_out({0, 1}, points[0]);
  throw_out({0, 1}, points[1]);
  association_.add_outliers({{{0, 55}, points[1]}, {{0, 1}, {0, 99999}}});
  shared_.write([&](Map& m) { m.erase_point(points[0]); });
  EXPECT_LE(refine(), 1);
  SharedMap empty;
  bool idle = false;
  EXPECT_EQ(association_.refine(&empty, 100, {}, &idle), 0);
  EXPECT_TRUE(idle);
}

}  // namespace
}  // namespace parallax
