#include "tracker/source_trust.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/tracker/desk_map.h"
#include "tracker/tracking_quality.h"

namespace parallax {
namespace {

constexpr int kPointsOfOne = 100;

// Keyframes 0 to n - 1 with a hundred points each; keyframe k's begin at row 100 k.
TrackingSnapshot long_walk(int keyframes) {
  TrackingSnapshot out;
  for (int k = 0; k < keyframes; ++k) {
    SnapshotKeyframe keyframe;
    keyframe.id = KeyframeId{0, k};
    out.keyframes.push_back(keyframe);
    out.source.insert(out.source.end(), kPointsOfOne, k);
  }
  return out;
}

// A frame that looked for all points of these keyframes and found so many hundredths of them where they should be.
TwoStageResult frame(const std::map<int, int>& found) {
  TwoStageResult out;
  out.ok = true;
  for (const auto& [keyframe, n] : found)
    for (int i = 0; i < kPointsOfOne; ++i) {
      const int row = kPointsOfOne * keyframe + i;
      if (i < n) {
        out.matches.push_back({.row = row, .weight = 1});
        ++out.inliers;
      } else {
        out.missed.push_back({.row = row});
      }
    }
  return out;
}

std::vector<int> out_of_place(SourceTrust* trust, const TrackingSnapshot& map) {
  std::vector<int> out;
  const std::vector<std::uint8_t>& rows = trust->out_of_place(map);
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (rows[k]) out.push_back(static_cast<int>(k));
  return out;
}

// Seen at the beginning, and again when the map has thirty keyframes.
SourceTrust walked() {
  SourceTrust trust;
  trust.update(frame({{0, 80}, {1, 80}}), long_walk(2));
  for (int k = 2; k < 29; ++k)
    for (int i = 0; i < 5; ++i) trust.update(frame({{k, 80}}), long_walk(k + 1));
  return trust;
}

TEST(SourceTrust, WhatComesBackBesideItsPlaceIsOutOfPlaceUntilItIsFound) {
  const TrackingSnapshot map = long_walk(30);
  SourceTrust trust = walked();
  EXPECT_TRUE(out_of_place(&trust, map).empty());
  trust.update(frame({{0, 3}, {28, 80}, {29, 80}}), map);
  // Keyframe 1, which nothing is known of any more, is taken for what the other old one is.
  std::vector<int> rows = out_of_place(&trust, map);
  ASSERT_GE(rows.size(), 2U);
  EXPECT_EQ(rows[0], 0);
  EXPECT_EQ(rows[1], 1);
  EXPECT_LT(rows.back(), 20) << "what was in view just now is not";

  TwoStageResult still = frame({{28, 80}, {29, 80}});
  for (int i = 0; i < 12; ++i) still.probed.push_back({.row = i, .found = i < 2, .agrees = false});
  trust.update(still, map);
  EXPECT_EQ(out_of_place(&trust, map).front(), 0);
  TwoStageResult closed = frame({{28, 80}, {29, 80}});
  for (int i = 0; i < 12; ++i) closed.probed.push_back({.row = i, .found = true, .agrees = i < 10});
  for (int i = 0; i < 20 && !out_of_place(&trust, map).empty(); ++i) trust.update(closed, map);
  EXPECT_TRUE(out_of_place(&trust, map).empty()) << "as after a loop is closed";
}

TEST(SourceTrust, WhatComesBackInItsPlaceIsTrusted) {
  const TrackingSnapshot map = long_walk(30);
  SourceTrust trust = walked();
  for (int i = 0; i < 10; ++i) {
    trust.update(frame({{0, 60}, {28, 80}, {29, 80}}), map);
    EXPECT_TRUE(out_of_place(&trust, map).empty());
  }
  // Once it is, what hides it later changes nothing.
  for (int i = 0; i < 10; ++i) trust.update(frame({{0, 0}, {28, 80}, {29, 80}}), map);
  EXPECT_TRUE(out_of_place(&trust, map).empty());
}

TEST(SourceTrust, ABadFrameJudgesNothing) {
  const TrackingSnapshot map = long_walk(30);
  SourceTrust trust = walked();
  SourceTrust few = trust;
  for (int i = 0; i < 30; ++i) trust.update(frame({{0, 0}, {28, 5}, {29, 5}}), map);
  EXPECT_TRUE(out_of_place(&trust, map).empty()) << "nothing is found at all: the pose is wrong, or it is dark";
  TwoStageResult little = frame({{0, 0}, {29, 80}});
  little.inliers = 40;
  few.update(little, map);
  EXPECT_TRUE(out_of_place(&few, map).empty());
}

TEST(SourceTrust, SmallMapsAndNewMapsAreNotJudged) {
  // Fewer keyframes than make an absence.
  const TrackingSnapshot small = long_walk(12);
  SourceTrust trust;
  trust.update(frame({{0, 80}}), long_walk(1));
  for (int i = 0; i < 200; ++i) trust.update(frame({{11, 80}}), small);
  trust.update(frame({{0, 0}, {11, 80}}), small);
  EXPECT_TRUE(out_of_place(&trust, small).empty());
  // A map that was loaded: nothing of it has been seen before.
  const TrackingSnapshot map = long_walk(30);
  SourceTrust loaded;
  loaded.update(frame({{0, 0}, {29, 80}}), map);
  EXPECT_TRUE(out_of_place(&loaded, map).empty());

  SourceTrust old = walked();
  old.update(frame({{0, 3}, {28, 80}, {29, 80}}), map);
  ASSERT_FALSE(out_of_place(&old, map).empty());
  // Another session's keyframe of that number.
  TrackingSnapshot renewed = map;
  renewed.keyframes[0].id.session = 1;
  old.update(frame({{0, 90}, {28, 80}, {29, 80}}), renewed);
  const std::vector<int> rows = out_of_place(&old, renewed);
  EXPECT_TRUE(rows.empty() || rows.front() != 0);
  old.clear();
  EXPECT_TRUE(out_of_place(&old, map).empty());
}

// Points of a keyframe that has drifted are there twice: where they are, and beside it. The latter neither count nor
// move the pose, and say so.
TEST(SourceTrust, PointsOutOfPlaceAreProbedAndLeaveThePoseAlone) {
  test::DeskMap& d = test::desk_map();
  // The third keyframe's part is moved by 4 cm.
  TrackingSnapshot drifted = *d.snapshot;
  const std::vector<std::uint8_t> third{0, 0, 1};
  int moved = 0;
  for (std::size_t row = 0; row < drifted.position.size(); ++row) {
    if (drifted.source[row] != 2) continue;
    ++moved;
    drifted.position[row].x() += 0.04;
    drifted.x[row] += 0.04F;
  }
  ASSERT_GT(moved, 30);
  const TrackerOptions options;
  const RigidTransform truth = d.views.camera_from_world(test::DeskMap::between);
  TwoStageTracker tracker(d.views.camera(), options);
  TwoStageRequest request;
  request.prior = truth;
  request.out_of_place = &third;
  TwoStageResult result;
  std::map<int, int> times;
  for (request.turn = 0; request.turn < kProbedOne; ++request.turn) {
    tracker.track(drifted, *d.views.images(test::DeskMap::between), request, &result);
    ASSERT_EQ(assess_quality(result, options), TrackingQuality::good);
    EXPECT_LT(test::centre_distance(result.camera_from_world, truth), 0.0015);
    for (const MatchedPoint& m : result.matches) EXPECT_NE(drifted.source[static_cast<std::size_t>(m.row)], 2);
    for (const Candidate& c : result.missed) EXPECT_NE(drifted.source[static_cast<std::size_t>(c.row)], 2);
    int agree = 0;
    for (const ProbedPoint& p : result.probed) {
      EXPECT_EQ(drifted.source[static_cast<std::size_t>(p.row)], 2);
      ++times[p.row];
      agree += p.agrees ? 1 : 0;
    }
    EXPECT_LE(5 * agree, static_cast<int>(result.probed.size()));
    // The same points where they are.
    tracker.track(*d.snapshot, *d.views.images(test::DeskMap::between), request, &result);
    agree = 0;
    for (const ProbedPoint& p : result.probed) agree += p.agrees ? 1 : 0;
    EXPECT_GE(5 * agree, 3 * static_cast<int>(result.probed.size()));
  }
  ASSERT_GT(times.size(), 15U);
  for (const auto& [row, n] : times) EXPECT_EQ(n, 1) << "all have their turn";
}

}  // namespace
}  // namespace parallax
