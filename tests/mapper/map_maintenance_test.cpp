#include "mapper/map_maintenance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

class MapMaintenanceTest : public ::testing::Test {
 protected:
  MapMaintenanceTest() { test::set_map(&shared_, test::true_map(&desk_views(), {0, 1, 2, 3, 4, 5, 6, 7}, 25)); }
  void expect_sound() { EXPECT_EQ(test::faults(shared_, desk_views().camera()), ""); }
  Map map() const { return test::copy_of(shared_); }

  SharedMap shared_;
};

PointCounts counts(PointId p, int searched, int found, int outliers) {
  PointCounts c;
  c.counts.push_back({p, static_cast<std::uint16_t>(searched), static_cast<std::uint16_t>(found),
                      static_cast<std::uint16_t>(outliers)});
  return c;
}

TEST_F(MapMaintenanceTest, CountsAddUpAndBadPointsGo) {
  const MapperOptions o;
  std::vector<PointId> ids;
  for (const MapPoint& p : map().points) ids.push_back(p.id);
  const PointId good = ids[1], outlier = ids[2], unseen = ids[3], mixed = ids[4];
  EXPECT_EQ(apply_counts(&shared_, o, counts(good, 500, 450, 30)), 0);
  EXPECT_EQ(apply_counts(&shared_, o, counts(mixed, 200, 100, o.bad_after_outliers + 10)), 0)
      << "outliers, but not the larger part";
  EXPECT_EQ(apply_counts(&shared_, o, counts(outlier, 20, 18, 18)), 0) << "too early to tell";
  EXPECT_EQ(apply_counts(&shared_, o, counts(outlier, 20, 18, 18)), 1);
  EXPECT_EQ(apply_counts(&shared_, o, counts(unseen, o.bad_after_searches, 1, 0)), 0);
  EXPECT_EQ(apply_counts(&shared_, o, counts(unseen, 5, 0, 0)), 1);
  const Map m = map();
  EXPECT_EQ(m.points.at(good).searched, 500);
  EXPECT_EQ(m.points.at(good).found, 450);
  EXPECT_EQ(m.points.at(good).pose_outliers, 30);
  EXPECT_TRUE(m.points.contains(mixed));
  EXPECT_FALSE(m.points.contains(outlier));
  EXPECT_FALSE(m.points.contains(unseen));
  expect_sound();
  EXPECT_EQ(apply_counts(&shared_, o, counts(outlier, 50, 50, 50)), 0) << "gone already";
}

TEST_F(MapMaintenanceTest, RemovingKeyframesKeepsEverySourceValid) {
  const Map before = map();
  const KeyframeId gone[] = {{0, 3}, {0, 5}};
  remove_keyframes(&shared_, desk_views().camera(), {gone[0], gone[1], {0, 77}});
  const Map after = map();
  expect_sound();
  EXPECT_EQ(after.keyframes.size(), 6);
  int moved = 0;
  for (const MapPoint& p : before.points) {
    int left = 0;
    for (KeyframeId id : p.observers) left += id != gone[0] && id != gone[1] ? 1 : 0;
    const MapPoint* now = after.points.find(p.id);
    if (left < 2) {
      EXPECT_EQ(now, nullptr) << "fewer than two observers are left";
      continue;
    }
    ASSERT_NE(now, nullptr);
    if (p.source != gone[0] && p.source != gone[1]) {
      EXPECT_EQ(now->source, p.source);
      continue;
    }
    ++moved;
    // The new source is an observer, and its patch is where the point is seen.
    const Measurement* m = after.keyframes.at(now->source).find(p.id);
    ASSERT_NE(m, nullptr);
    EXPECT_EQ(now->source_level, m->level);
    EXPECT_NEAR((level_to_level0(now->source_pixel, now->source_level) - m->pixel).norm(), 0, 1e-9);
    EXPECT_EQ(now->position, p.position);
  }
  EXPECT_GT(moved, 10);
}

TEST_F(MapMaintenanceTest, TheFixedKeyframeStays) {
  remove_keyframes(&shared_, desk_views().camera(), {{0, 0}});
  EXPECT_TRUE(map().keyframes.contains({0, 0}));
  std::vector<KeyframeId> all;
  for (int i = 0; i < 8; ++i) all.push_back({0, i});
  remove_keyframes(&shared_, desk_views().camera(), all);
  EXPECT_EQ(map().keyframes.size(), 1);
  expect_sound();
}

TEST_F(MapMaintenanceTest, CullingKeepsTheMapBounded) {
  // Views close together: each sees what its neighbours see.
  test::RenderedViews close(test::slide(12, 0.006));
  std::vector<int> all;
  for (int i = 0; i < close.size(); ++i) all.push_back(i);
  test::set_map(&shared_, test::true_map(&close, all, 15));
  MapperOptions o;
  o.cull_above_keyframes = 6;
  o.redundant_part = 0.8;
  const KeyframeId newest{0, 11};
  int culled = 0;
  while (culled < 20 && cull_redundant_keyframe(&shared_, close.camera(), o, newest)) {
    ++culled;
    EXPECT_EQ(test::faults(shared_, close.camera()), "");
  }
  EXPECT_EQ(culled, 6);
  const Map m = map();
  EXPECT_EQ(m.keyframes.size(), 6);
  EXPECT_TRUE(m.keyframes.contains(newest));
  EXPECT_TRUE(m.keyframes.contains({0, 0}));
  EXPECT_GT(m.points.size(), 20);
}

TEST_F(MapMaintenanceTest, AKeyframeThatIsNeededIsNotCulled) {
  // Spread-out points of their own, few observers each.
  shared_.write([](Map& m) {
    for (Keyframe& kf : m.keyframes) {
      const std::vector<Measurement> list = kf.measurements;
      for (const Measurement& x : list)
        if (m.points.at(x.point).observers.size() > 3 && x.source != MeasurementSource::root)
          m.remove_measurement(kf.id, x.point);
    }
  });
  MapperOptions o;
  o.cull_above_keyframes = 3;
  EXPECT_FALSE(cull_redundant_keyframe(&shared_, desk_views().camera(), o, {0, 7}));
  EXPECT_EQ(map().keyframes.size(), 8);
}

TEST_F(MapMaintenanceTest, AFullMapCullsWhatItMustAndNoMore) {
  MapperOptions o;
  o.cull_above_keyframes = 3;
  o.max_keyframes = 5;
  const KeyframeId newest{0, 7};
  int culled = 0;
  while (culled < 20 && cull_redundant_keyframe(&shared_, desk_views().camera(), o, newest)) {
    ++culled;
    expect_sound();
  }
  EXPECT_GE(culled, 3) << "above its size any goes";
  EXPECT_GE(map().keyframes.size(), o.cull_above_keyframes);
  EXPECT_TRUE(map().keyframes.contains(newest));
  EXPECT_TRUE(map().keyframes.contains({0, 0}));
}

TEST_F(MapMaintenanceTest, AKeyframeWhoseThingsHaveGoneIsRetired) {
  MapperOptions o;
  const KeyframeId newest{0, 7};
  EXPECT_EQ(retire_keyframes(&shared_, desk_views().camera(), o, newest), 0);
  // All but a few of the points that the fixed keyframe and another measure are gone.
  shared_.write([&](Map& m) {
    for (const KeyframeId id : {KeyframeId{0, 0}, KeyframeId{0, 3}}) {
      const std::vector<Measurement> list = m.keyframes.at(id).measurements;
      for (std::size_t i = 5; i < list.size(); ++i) m.remove_measurement(id, list[i].point);
    }
    std::vector<PointId> gone;
    for (const MapPoint& p : m.points)
      if (p.observers.size() < 2 || p.source == KeyframeId{0, 0} || p.source == KeyframeId{0, 3}) gone.push_back(p.id);
    for (PointId p : gone) m.erase_point(p);
  });
  const int points = map().points.size();
  EXPECT_EQ(retire_keyframes(&shared_, desk_views().camera(), o, newest), 2);
  expect_sound();
  const Map after = map();
  EXPECT_FALSE(after.keyframes.contains({0, 0}));
  EXPECT_FALSE(after.keyframes.contains({0, 3}));
  EXPECT_GT(after.points.size(), points / 2);
  std::size_t most = 0, fixed = 0;
  int how_many = 0;
  for (const Keyframe& kf : after.keyframes) {
    most = std::max(most, kf.measurements.size());
    if (!kf.fixed) continue;
    ++how_many;
    fixed = kf.measurements.size();
  }
  EXPECT_EQ(how_many, 1) << "the gauge is held by another";
  EXPECT_EQ(fixed, most);
}

TEST_F(MapMaintenanceTest, WhatWasSeenOnEarlierDaysCountsForLittle) {
  MapperOptions o;
  const PointId moved{0, 3};
  apply_counts(&shared_, o, counts(moved, 900, 880, 2));
  Map m = map();
  const PointCounts today = counts(moved, 150, 0, 0);
  test::set_map(&shared_, m);
  EXPECT_EQ(apply_counts(&shared_, o, today), 0) << "within one day it may be hidden for a while";
  age_counts(&m);
  EXPECT_EQ(m.points.at(moved).searched, 10);
  EXPECT_EQ(m.points.at(moved).found, 10);
  test::set_map(&shared_, m);
  EXPECT_EQ(apply_counts(&shared_, o, today), 1);
}

TEST_F(MapMaintenanceTest, TwoPointsOfOnePlaceAreMerged) {
  const KeyframeId newest{0, 7};
  // Twins of some of the newest keyframe's points, as a second search would make them; and two points that only look
  // near.
  std::vector<std::pair<PointId, PointId>> twins;
  PointId behind;
  shared_.write([&](Map& m) {
    std::vector<PointId> originals;
    for (const MapPoint& p : m.points)
      if (std::binary_search(p.observers.begin(), p.observers.end(), newest) && p.observers.size() >= 3)
        originals.push_back(p.id);
    for (std::size_t i = 0; i + 1 < originals.size() && twins.size() < 6; i += 3) {
      const MapPoint original = m.points.at(originals[i]);
      MapPoint twin = original;
      twin.observers.clear();
      twin.position += Eigen::Vector3d(1e-4, 0, 0);
      const PointId id = m.points.insert(twin);
      for (KeyframeId kf : {original.source, newest}) {
        Measurement x = *m.keyframes.at(kf).find(originals[i]);
        x.point = id;
        x.pixel += Eigen::Vector2d(0.3, -0.2);
        if (m.keyframes.at(kf).find(id) == nullptr) m.add_measurement(kf, x);
      }
      twins.emplace_back(originals[i], id);
    }
    // Seen through a gap: the same pixel, a third further away.
    const MapPoint front = m.points.at(originals[1]);
    MapPoint far = front;
    far.observers.clear();
    const Eigen::Vector3d from = m.keyframes.at(newest).centre();
    far.position = from + 1.35 * (front.position - from);
    behind = m.points.insert(far);
    Measurement x = *m.keyframes.at(newest).find(originals[1]);
    x.point = behind;
    x.source = MeasurementSource::refind;
    m.add_measurement(newest, x);
  });
  ASSERT_EQ(twins.size(), 6U);
  const int merged = merge_duplicates(&shared_, newest);
  expect_sound();
  const Map m = map();
  EXPECT_GE(merged, 5);
  int kept = 0;
  for (const auto& [original, twin] : twins) {
    EXPECT_TRUE(m.points.contains(original)) << "the better measured one stays";
    kept += m.points.contains(twin) ? 1 : 0;
  }
  EXPECT_LE(kept, 1);
  EXPECT_TRUE(m.points.contains(behind));
  EXPECT_EQ(merge_duplicates(&shared_, {0, 99}), 0);
}

TEST_F(MapMaintenanceTest, ASoundMapIsNotMerged) {
  const int before = map().points.size();
  const int merged = merge_duplicates(&shared_, {0, 4});
  EXPECT_LE(merged, 0.03 * before);
}

}  // namespace
}  // namespace parallax
