// The tracking thread's state machine, frame by frame. The test plays the mapper: it answers requests with the true
// map.
#include "tracker/tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <utility>
#include <variant>
#include <vector>

#include "core/check.h"
#include "tests/support/rendered_views.h"

namespace parallax {
namespace {

using test::centre_distance;
using test::RenderedViews;
using test::turn_between;

constexpr int kSecondKey = 8;

// Along the table, 1 cm a frame to frame 8, then half a centimetre, turning a little.
std::vector<RigidTransform> path() {
  std::vector<RigidTransform> out;
  for (int i = 0; i < 45; ++i) {
    const double x = -0.08 + (i <= kSecondKey ? 0.01 * i : 0.08 + 0.005 * (i - kSecondKey));
    out.push_back(test::above_desk(x, i <= kSecondKey ? 0.0 : 0.004 * (i - kSecondKey)));
  }
  return out;
}

RenderedViews& views() {
  static RenderedViews v(path());
  return v;
}

const Map& true_desk() {
  static const Map m = test::true_map(&views(), {0, kSecondKey, 20, 35}, 120);
  return m;
}

class TrackerTest : public ::testing::Test {
 protected:
  explicit TrackerTest(bool automatic = false, std::size_t capacity = 8)
      : inbox_(capacity), tracker_(views().camera(), options(), automatic, &map_, &inbox_) {}

  static TrackerOptions options() {
    TrackerOptions o;
    o.keyframe_interval_frames = 6;
    o.keyframe_distance_over_depth = 0.02;
    return o;
  }

  TrackingResult track(int view, bool key = false) {
    Frame f = views().frame(view);
    return track(f, key);
  }
  TrackingResult track(Frame f, bool key = false) {
    f.index = next_index_++;
    f.time = from_seconds(10 + f.index / 30.0);
    f.grey = f.grey.clone();
    TrackingResult r = tracker_.track(f, key);
    EXPECT_EQ(r.frame, f.index);
    EXPECT_EQ(r.time, f.time);
    EXPECT_EQ(r.camera_from_world.has_value(),
              r.state == TrackingState::tracking && r.quality != TrackingQuality::lost);
    return r;
  }

  // What the mapper does with what was sent; proposals and counts are kept.
  void answer(bool ok = true) {
    while (auto message = inbox_.try_pop()) {
      if (auto* request = std::get_if<InitialisationRequest>(&*message)) {
        ++requests_;
        InitialisationReply reply;
        reply.ok = ok;
        if (ok) {
          map_.replace_map(true_desk());
          map_.publish();
          reply.second_from_world = views().camera_from_world(kSecondKey);
        } else {
          reply.reason = "slide further";
        }
        request->reply.set_value(reply);
      } else if (auto* proposal = std::get_if<KeyframeProposal>(&*message)) {
        proposals_.push_back(std::move(*proposal));
      } else if (auto* counts = std::get_if<PointCounts>(&*message)) {
        counts_.push_back(std::move(*counts));
      }
    }
  }

  // From nothing to tracking at frame 8; the next view to track is 9.
  void start() {
    track(0, true);
    for (int i = 1; i < kSecondKey; ++i) track(i);
    ASSERT_EQ(track(kSecondKey, true).state, TrackingState::initialising);
    answer();
    expect_at(track(kSecondKey), kSecondKey);
  }

  void expect_at(const TrackingResult& r, int view, const SimilarityTransform& world_from_true = {}) {
    ASSERT_EQ(r.state, TrackingState::tracking) << "view " << view << ": " << r.message;
    ASSERT_TRUE(r.camera_from_world) << "view " << view << " found " << r.total_found() << " of "
                                     << r.total_attempted();
    const RigidTransform truth = world_from_true.rebase(views().camera_from_world(view));
    EXPECT_LT(centre_distance(*r.camera_from_world, truth) / world_from_true.s, 0.003) << "view " << view;
    EXPECT_LT(turn_between(*r.camera_from_world, truth), 0.005) << "view " << view;
  }

  SharedMap map_;
  MapperInbox inbox_;
  Tracker tracker_;
  int next_index_ = 0, requests_ = 0;
  std::vector<KeyframeProposal> proposals_;
  std::vector<PointCounts> counts_;
};

Frame blank_frame() {
  Frame f;
  f.grey = GreyImage(240, 320, static_cast<std::uint8_t>(30));
  return f;
}

// A part of the map comes back into view beside its place, after twenty other keyframes: its points are left out.
TEST_F(TrackerTest, APartThatIsOutOfPlaceIsLeftOut) {
  start();
  int view = kSecondKey + 1;
  TrackingResult before;
  for (; view < 14; ++view) before = track(view);
  answer();
  const std::vector<std::int32_t> source = map_.snapshot()->source;
  const auto drifted = static_cast<int>(std::count(source.begin(), source.end(), 1));
  ASSERT_GE(drifted, 60);
  ASSERT_LT(2 * drifted, static_cast<int>(source.size()));
  const KeyframeId second = map_.snapshot()->keyframes[1].id;
  const auto shift = [&](double metres) {
    map_.write([&](Map& m) {
      for (MapPoint& p : m.points)
        if (p.source == second) p.position.x() += metres;
    });
  };
  shift(50);  // out of view
  map_.write([](Map& m) {
    Keyframe elsewhere = *m.keyframes.begin();
    elsewhere.measurements.clear();
    elsewhere.camera_from_world.t.x() += 50;
    for (int i = 0; i < 20; ++i) m.keyframes.insert(elsewhere);
  });
  map_.publish();
  for (int i = 0; i < 3; ++i, ++view) expect_at(track(view), view);
  shift(0.04 - 50);
  map_.publish();
  TrackingResult without;
  for (int i = 0; i < 4; ++i, ++view) expect_at(without = track(view), view);
  EXPECT_LT(without.total_attempted(), before.total_attempted() - drifted / 2);
  EXPECT_EQ(without.quality, TrackingQuality::good);
  EXPECT_GT(without.total_found(), 0.5 * without.total_attempted());
}

TEST_F(TrackerTest, FromTwoKeyPressesToTracking) {
  EXPECT_EQ(track(0).state, TrackingState::waiting);
  start();
  for (int i = kSecondKey + 1; i < 36; ++i) {
    const TrackingResult r = track(i);
    expect_at(r, i);
    EXPECT_EQ(r.quality, TrackingQuality::good);
    EXPECT_EQ(r.map_points, true_desk().points.size());
    EXPECT_EQ(r.map_keyframes, 4);
    EXPECT_EQ(r.map_version, 1U);
    EXPECT_GT(r.total_found(), 50);
    EXPECT_LE(r.total_found(), r.total_attempted());
    EXPECT_EQ(static_cast<int>(r.points.size()), r.total_attempted());
    EXPECT_TRUE(r.trails.empty());
  }
}

TEST_F(TrackerTest, ARefusedPressIsRepeated) {
  track(0, true);
  for (int i = 1; i < 4; ++i) track(i);
  track(4, true);
  answer(false);
  const TrackingResult refused = track(5);
  EXPECT_EQ(refused.state, TrackingState::trailing);
  EXPECT_EQ(refused.message, "slide further");
  EXPECT_FALSE(refused.trails.empty());
  for (int i = 6; i < kSecondKey; ++i) track(i);
  track(kSecondKey, true);
  answer();
  expect_at(track(kSecondKey), kSecondKey);
  expect_at(track(kSecondKey + 1), kSecondKey + 1);
  EXPECT_EQ(requests_, 2);
}

TEST_F(TrackerTest, ProposesKeyframesThatStayAsTheyWere) {
  start();
  std::vector<GreyImage> pictures;
  int proposed = 0;
  for (int i = kSecondKey + 1; i < 36; ++i) {
    const TrackingResult r = track(i);
    answer();
    if (!r.keyframe_proposed) continue;
    ++proposed;
    ASSERT_EQ(proposals_.size(), static_cast<std::size_t>(proposed));
    const KeyframeProposal& p = proposals_.back();
    EXPECT_EQ(p.frame, r.frame);
    EXPECT_EQ(p.time, r.time);
    EXPECT_EQ(p.map_version, 1U);
    EXPECT_EQ(p.camera_from_world.t, r.camera_from_world->t);
    EXPECT_EQ(cv::norm(p.images->pyramid.level[0], views().frame(i).grey, cv::NORM_INF), 0);
    EXPECT_GT(p.measurements.size(), 50U);
    for (const Measurement& m : p.measurements) {
      Eigen::Vector2d px;
      ASSERT_TRUE(
          views().camera().project(views().camera_from_world(i) * true_desk().points.at(m.point).position, &px));
      EXPECT_LT((m.pixel - px).norm(), 4 * level_scale(m.level));
      EXPECT_EQ(m.source, MeasurementSource::tracker);
    }
    pictures.push_back(p.images->pyramid.level[1].clone());
  }
  EXPECT_GE(proposed, 2);
  EXPECT_LE(proposed, 7) << "not more often than every few frames";
  for (std::size_t i = 0; i < proposals_.size(); ++i)
    EXPECT_EQ(cv::norm(proposals_[i].images->pyramid.level[1], pictures[i], cv::NORM_INF), 0)
        << "written after it was given away";
}

TEST_F(TrackerTest, CountsOfPointsAddUp) {
  start();
  answer();
  counts_.clear();
  std::map<int, int> found;
  int frames = 0;
  for (int i = kSecondKey + 1; i < 34; ++i, ++frames) {
    track(i);
    answer();
  }
  ASSERT_FALSE(counts_.empty());
  for (const PointCounts& message : counts_) {
    EXPECT_EQ(message.map_version, 1U);
    for (const PointCount& c : message.counts) {
      EXPECT_TRUE(true_desk().points.contains(c.point));
      EXPECT_GT(c.searched, 0);
      EXPECT_LE(c.found, c.searched);
      EXPECT_LE(c.outliers, c.found);
      found[c.point.index] += c.searched;
    }
  }
  for (const auto& [point, n] : found) EXPECT_LE(n, frames + 1);
}

class NoRoomTest : public TrackerTest {
 protected:
  NoRoomTest() : TrackerTest(false, 1) {}
};

TEST_F(NoRoomTest, ARefusedKeyframeIsOfferedLater) {
  start();
  MapperMessage other = PointCounts();
  ASSERT_TRUE(inbox_.try_push(other));
  for (int i = kSecondKey + 1; i < 26; ++i) {
    const TrackingResult r = track(i);
    EXPECT_FALSE(r.keyframe_proposed);
    expect_at(r, i);
  }
  answer();
  bool proposed = false;
  for (int i = 26; i < 32; ++i) {
    proposed = track(i).keyframe_proposed || proposed;
    answer();
  }
  EXPECT_TRUE(proposed);
}

TEST_F(TrackerTest, AMovedWorldIsFollowedWithoutAJump) {
  start();
  for (int i = kSecondKey + 1; i < 14; ++i) track(i);
  SimilarityTransform total;
  const SimilarityTransform moves[] = {{2.0, exp_so3({0, 0, 1.1}), {5, -3, 1}},
                                       {0.25, exp_so3({0.4, -0.8, 0}), {0, 0, -2}},
                                       {1.0, exp_so3({0, 2.0, 0}), {0.1, 0, 0}}};
  int view = 14;
  for (const SimilarityTransform& move : moves) {
    map_.move_world(move);
    map_.publish();
    total = move * total;
    for (int k = 0; k < 3; ++k, ++view) {
      const TrackingResult r = track(view);
      expect_at(r, view, total);
      EXPECT_EQ(r.quality, TrackingQuality::good);
      EXPECT_NEAR(r.world_from_first.s, total.s, 1e-12);
    }
  }
  // Two moves between two frames.
  for (const SimilarityTransform& move : {moves[0], moves[1]}) {
    map_.move_world(move);
    total = move * total;
  }
  map_.publish();
  expect_at(track(view), view, total);
  expect_at(track(view + 1), view + 1, total);
}

TEST_F(TrackerTest, AResetMapIsStartedAnew) {
  start();
  for (int i = kSecondKey + 1; i < 14; ++i) track(i);
  map_.replace_map({});
  map_.publish();
  const TrackingResult r = track(14);
  EXPECT_EQ(r.state, TrackingState::waiting);
  EXPECT_EQ(r.map_points, 0);
  answer();
  // And again from the first key press.
  start();
  EXPECT_EQ(requests_, 2);
  const TrackingResult again = track(kSecondKey + 1);
  expect_at(again, kSecondKey + 1);
  EXPECT_EQ(again.map_version, 3U);
}

TEST_F(TrackerTest, LostAfterAFewBadFramesAndBackWhenTheViewIsBack) {
  start();
  for (int i = kSecondKey + 1; i < 16; ++i) track(i);
  answer();
  proposals_.clear();
  for (int k = 0; k < 8; ++k) {
    const TrackingResult r = track(blank_frame());
    EXPECT_EQ(r.state, k < options().lost_after_frames ? TrackingState::tracking : TrackingState::lost) << k;
    EXPECT_FALSE(r.camera_from_world);
    EXPECT_EQ(r.quality, TrackingQuality::lost);
    EXPECT_FALSE(r.keyframe_proposed);
    if (k > options().lost_after_frames) {
      EXPECT_FALSE(r.message.empty());
    }
  }
  // The camera comes back elsewhere on its path.
  TrackingResult r;
  for (int k = 0; k < 10 && !r.camera_from_world; ++k) r = track(34);
  expect_at(r, 34);
  EXPECT_TRUE(r.relocalised);
  for (int i = 35; i < 40; ++i) {
    r = track(i);
    expect_at(r, i);
    EXPECT_FALSE(r.relocalised);
  }
}

TEST_F(TrackerTest, OneBadFrameIsBridged) {
  start();
  for (int i = kSecondKey + 1; i < 16; ++i) track(i);
  EXPECT_FALSE(track(blank_frame()).camera_from_world);
  const TrackingResult r = track(17);
  expect_at(r, 17);
  EXPECT_FALSE(r.relocalised);
}

TEST_F(TrackerTest, AnotherPlaceIsNeverTakenForThisOne) {
  start();
  for (int i = kSecondKey + 1; i < 14; ++i) track(i);
  std::vector<RigidTransform> elsewhere;
  for (int i = 0; i < 12; ++i) {
    RigidTransform p = test::above_desk(0.005 * i);
    p.t.x() += 20;
    elsewhere.push_back(p);
  }
  RenderedViews other(elsewhere);
  for (int i = 0; i < other.size(); ++i) EXPECT_FALSE(track(other.frame(i)).camera_from_world) << i;
  TrackingResult r;
  for (int k = 0; k < 10 && !r.camera_from_world; ++k) r = track(14);
  expect_at(r, 14);
}

class AutomaticTrackerTest : public TrackerTest {
 protected:
  AutomaticTrackerTest() : TrackerTest(true) {}
};

TEST_F(AutomaticTrackerTest, NeedsNoKey) {
  TrackingResult r;
  int view = 0;
  for (; view < kSecondKey && requests_ == 0; ++view) {
    r = track(view);
    while (auto message = inbox_.try_pop()) {
      auto* request = std::get_if<InitialisationRequest>(&*message);
      ASSERT_NE(request, nullptr);
      EXPECT_TRUE(request->automatic);
      ++requests_;
      map_.replace_map(true_desk());
      map_.publish();
      InitialisationReply reply;
      reply.ok = true;
      reply.second_from_world = views().camera_from_world(view);
      request->reply.set_value(reply);
    }
  }
  ASSERT_EQ(requests_, 1);
  for (; view < 16; ++view) expect_at(track(view), view);
}

TEST_F(TrackerTest, AFrameOfAnotherSizeIsABug) {
  Frame f;
  f.grey = GreyImage(100, 100, static_cast<std::uint8_t>(0));
  EXPECT_THROW(tracker_.track(f), CheckFailure);
}

TEST(Tracker, TheSameFramesGiveTheSamePosesToTheLastBit) {
  const auto run = [] {
    SharedMap map;
    MapperInbox inbox(8);
    Tracker tracker(views().camera(), TrackerOptions(), false, &map, &inbox);
    std::vector<RigidTransform> poses;
    for (int i = 0; i < 24; ++i) {
      const TrackingResult r = tracker.track(views().frame(i), i == 0 || i == kSecondKey);
      if (r.camera_from_world) poses.push_back(*r.camera_from_world);
      while (auto message = inbox.try_pop()) {
        auto* request = std::get_if<InitialisationRequest>(&*message);
        if (!request) continue;
        map.replace_map(true_desk());
        map.publish();
        InitialisationReply reply;
        reply.ok = true;
        reply.second_from_world = views().camera_from_world(i);
        request->reply.set_value(reply);
      }
    }
    return poses;
  };
  const auto a = run(), b = run();
  ASSERT_EQ(a.size(), b.size());
  ASSERT_EQ(a.size(), 15U);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].R, b[i].R);
    EXPECT_EQ(a[i].t, b[i].t);
  }
}

}  // namespace
}  // namespace parallax
