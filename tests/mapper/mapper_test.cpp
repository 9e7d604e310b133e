// The mapping thread as a whole: stepped over synthetic recordings, with the map checked after every step.
#include "mapper/mapper.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <future>
#include <thread>
#include <utility>
#include <vector>

#include "tests/mapper/desk_fixture.h"
#include "tracker/tracker.h"

namespace parallax {
namespace {

using test::faults;

constexpr int kFirstKey = 0, kSecondKey = 10;

// Along the table and back while turning: 48 frames.
test::RenderedViews& recording() {
  static test::RenderedViews views([] {
    std::vector<RigidTransform> out;
    for (int i = 0; i < 48; ++i) {
      const double x = i <= kSecondKey ? 0.01 * i : 0.1 + 0.06 * std::sin(0.12 * (i - kSecondKey));
      out.push_back(test::above_desk(x - 0.08, i <= kSecondKey ? 0.0 : 0.01 * (i - kSecondKey), 0.68 - 0.001 * i));
    }
    return out;
  }());
  return views;
}

TrackerOptions eager() {
  TrackerOptions o;
  o.keyframe_interval_frames = 5;
  o.keyframe_distance_over_depth = 0.04;
  return o;
}

struct Outcome {
  Map map;
  MapperStatistics statistics;
  std::vector<std::pair<int, RigidTransform>> poses;
  int steps = 0;
};

Outcome run(bool check) {
  Outcome out;
  SharedMap map;
  MapperInbox inbox(8);
  Mapper mapper(recording().camera(), MapperOptions(), &map, &inbox);
  Tracker tracker(recording().camera(), eager(), false, &map, &inbox);
  for (int i = 0; i < recording().size(); ++i) {
    const TrackingResult r = tracker.track(recording().frame(i), i == kFirstKey || i == kSecondKey);
    if (r.camera_from_world) out.poses.emplace_back(i, *r.camera_from_world);
    while (mapper.step()) {
      ++out.steps;
      if (check) {
        EXPECT_EQ(faults(map, recording().camera()), "") << "frame " << i << " step " << out.steps;
      }
      if (out.steps > 5000) {
        ADD_FAILURE() << "the mapper does not come to rest";
        break;
      }
    }
  }
  out.map = test::copy_of(map);
  out.statistics = mapper.statistics();
  return out;
}

const Outcome& checked_run() {
  static const Outcome o = run(true);
  return o;
}

TEST(Mapper, TheMapIsSoundAfterEveryStep) {
  const Outcome& o = checked_run();
  EXPECT_GT(o.steps, 20);
  EXPECT_EQ(o.statistics.keyframes_inserted + 2 - o.statistics.keyframes_culled - o.statistics.keyframes_rejected,
            o.map.keyframes.size());
  EXPECT_GE(o.statistics.keyframes_inserted, 3);
  EXPECT_EQ(o.statistics.keyframes_rejected, 0);
  EXPECT_GE(o.statistics.local_adjustments, o.statistics.keyframes_inserted);
  EXPECT_GE(o.statistics.global_adjustments, 1);
  EXPECT_GT(o.statistics.points_made, 50);
  EXPECT_GT(o.statistics.measurements_added, 0);
  EXPECT_GT(o.map.points.size(), 300);
  EXPECT_LT(test::reprojection_rms(o.map, recording().camera()), 1.0);
}

TEST(Mapper, EveryFrameIsTrackedAndTrue) {
  const Outcome& o = checked_run();
  ASSERT_GE(o.poses.size(), static_cast<std::size_t>(recording().size() - kSecondKey - 2));
  Eigen::Matrix3Xd mine(3, o.poses.size()), truth(3, o.poses.size());
  for (std::size_t i = 0; i < o.poses.size(); ++i) {
    mine.col(static_cast<Eigen::Index>(i)) = o.poses[i].second.inverse().t;
    truth.col(static_cast<Eigen::Index>(i)) = recording().camera_from_world(o.poses[i].first).inverse().t;
  }
  SimilarityTransform true_from_map;
  ASSERT_TRUE(align_points(mine, truth, true, &true_from_map));
  EXPECT_NEAR(true_from_map.s, 1.0, 0.08) << "the camera did translate 10 cm between the key presses";
  double sum2 = 0;
  for (Eigen::Index i = 0; i < mine.cols(); ++i)
    sum2 += (true_from_map * Eigen::Vector3d(mine.col(i)) - truth.col(i)).squaredNorm();
  EXPECT_LT(std::sqrt(sum2 / static_cast<double>(mine.cols())), 0.004) << "metres";
}

TEST(Mapper, LockstepIsDeterministicToTheLastBit) {
  const Outcome &a = checked_run(), b = run(false);
  EXPECT_EQ(a.steps, b.steps);
  ASSERT_EQ(a.poses.size(), b.poses.size());
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_EQ(a.poses[i].first, b.poses[i].first);
    EXPECT_EQ(a.poses[i].second.t, b.poses[i].second.t);
    EXPECT_EQ(a.poses[i].second.R, b.poses[i].second.R);
  }
  ASSERT_EQ(a.map.points.size(), b.map.points.size());
  for (const MapPoint& p : a.map.points) {
    const MapPoint* q = b.map.points.find(p.id);
    ASSERT_NE(q, nullptr);
    EXPECT_EQ(p.position, q->position);
    EXPECT_EQ(p.normal, q->normal);
    EXPECT_EQ(p.observers, q->observers);
  }
  ASSERT_EQ(a.map.keyframes.size(), b.map.keyframes.size());
  for (const Keyframe& kf : a.map.keyframes)
    EXPECT_EQ(kf.camera_from_world.t, b.map.keyframes.at(kf.id).camera_from_world.t);
}

// A mapper with a true map of the desk, and what the tracker would offer it.
class MapperTest : public ::testing::Test {
 protected:
  MapperTest() : mapper_(test::desk_views().camera(), MapperOptions(), &map_, &inbox_) {
    test::set_map(&map_, test::true_map(&test::desk_views(), {1, 4}, 60));
  }

  KeyframeProposal proposal(int view) {
    const auto snapshot = map_.snapshot();
    KeyframeProposal p;
    p.frame = view;
    p.camera_from_world = test::desk_views().camera_from_world(view);
    p.map_version = snapshot->map_version;
    p.world_version = snapshot->world_version;
    p.world = snapshot->stamp();
    p.images = test::desk_views().images(view);
    for (std::size_t i = 0; i < snapshot->id.size(); i += 2) {
      const auto px = test::desk_views().project_visible(view, snapshot->position[i], 10);
      if (px) p.measurements.push_back({snapshot->id[i], *px, 1.0F, 0, MeasurementSource::tracker});
    }
    return p;
  }
  bool push(MapperMessage message) { return inbox_.try_push(message); }
  void settle() {
    int steps = 0;
    while (mapper_.step()) {
      ASSERT_EQ(faults(map_, test::desk_views().camera()), "");
      ASSERT_LT(++steps, 3000);
    }
  }

  SharedMap map_;
  MapperInbox inbox_{8};
  Mapper mapper_;
};

TEST_F(MapperTest, AtRestThereIsNothingToDo) {
  EXPECT_FALSE(mapper_.step());
  push(proposal(2));
  settle();
  EXPECT_FALSE(mapper_.step());
  EXPECT_EQ(mapper_.statistics().keyframes_inserted, 1);
  EXPECT_EQ(map_.snapshot()->keyframes.size(), 3U) << "published";
}

TEST_F(MapperTest, AResetIsAnsweredWhenTheMapIsEmpty) {
  push(proposal(2));
  for (int i = 0; i < 2; ++i) mapper_.step();
  ResetRequest reset;
  auto done = reset.done.get_future();
  push(std::move(reset));
  const KeyframeProposal stale = proposal(3);
  ASSERT_TRUE(mapper_.step()) << "before the adjustments that are pending";
  ASSERT_EQ(done.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  EXPECT_TRUE(map_.snapshot()->empty());
  EXPECT_EQ(map_.snapshot()->map_version, 2U);
  EXPECT_FALSE(mapper_.step()) << "nothing of the old map is left to do";
  // What the tracker sent of the old map is not taken.
  push(stale);
  PointCounts counts;
  counts.map_version = 1;
  counts.counts.push_back({{0, 0}, 500, 0, 0});
  push(counts);
  settle();
  EXPECT_EQ(mapper_.statistics().keyframes_refused, 1);
  EXPECT_TRUE(map_.snapshot()->empty());
}

TEST_F(MapperTest, AScaleMovesTheWorldAndSaysSo) {
  const auto before = map_.snapshot();
  for (const double factor : {0.0, -1.0, std::nan(""), 1e9}) {
    ScaleRequest refused;
    refused.factor = factor;
    auto reply = refused.reply.get_future();
    push(std::move(refused));
    settle();
    EXPECT_FALSE(reply.get().ok) << factor;
  }
  EXPECT_EQ(map_.snapshot()->world_version, before->world_version);
  const KeyframeProposal on_the_way = proposal(3);  // tracked in the old world
  ScaleRequest scale;
  scale.factor = 2.5;
  auto reply = scale.reply.get_future();
  push(std::move(scale));
  settle();
  EXPECT_TRUE(reply.get().ok);
  const auto after = map_.snapshot();
  EXPECT_EQ(after->world_version, before->world_version + 1);
  EXPECT_EQ(after->map_version, before->map_version);
  EXPECT_EQ(after->world_from_first.s, 2.5);
  ASSERT_EQ(after->size(), before->size());
  for (int i = 0; i < after->size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    EXPECT_LT((after->position[row] - 2.5 * before->position[row]).norm(), 1e-9);
  }
  push(on_the_way);
  settle();
  const auto grown = map_.snapshot();
  ASSERT_EQ(grown->keyframes.size(), 3U) << "taken into the new world";
  const Eigen::Vector3d expected = 2.5 * on_the_way.camera_from_world.inverse().t;
  EXPECT_LT((grown->keyframes.back().centre - expected).norm(), 0.02);
}

TEST_F(MapperTest, PlanesAreFoundOnRequest) {
  PlaneRequest again;
  auto reply = again.reply.get_future();
  push(std::move(again));
  settle();
  EXPECT_TRUE(reply.get().ok);
  ASSERT_TRUE(map_.snapshot()->plane);
  EXPECT_EQ(map_.snapshot()->planes.size(), 1U);
  PlaneRequest nowhere;
  nowhere.seed = Eigen::Vector3d(50, 50, 50);
  reply = nowhere.reply.get_future();
  push(std::move(nowhere));
  settle();
  const MapEditReply refused = reply.get();
  EXPECT_FALSE(refused.ok);
  EXPECT_FALSE(refused.reason.empty());
}

TEST_F(MapperTest, CountsOfAnotherMapAreIgnored) {
  const PointId never_found = map_.snapshot()->id[3];
  PointCounts counts;
  counts.map_version = 0;
  counts.counts.push_back({never_found, 5000, 0, 0});
  push(counts);
  settle();
  EXPECT_EQ(mapper_.statistics().points_erased, 0);
  counts.map_version = map_.snapshot()->map_version;
  push(counts);
  settle();
  EXPECT_EQ(mapper_.statistics().points_erased, 1);
  const auto snapshot = map_.snapshot();
  EXPECT_FALSE(std::binary_search(snapshot->id.begin(), snapshot->id.end(), never_found)) << "the tracker sees it gone";
}

TEST_F(MapperTest, ARefusedInitialisationLeavesTheMap) {
  InitialisationRequest request;
  request.first = request.second = test::desk_views().images(2);
  auto reply = request.reply.get_future();
  push(std::move(request));
  ASSERT_TRUE(mapper_.step());
  const InitialisationReply r = reply.get();
  EXPECT_FALSE(r.ok);
  EXPECT_FALSE(r.reason.empty());
  EXPECT_EQ(map_.snapshot()->keyframes.size(), 2U);
}

// The real loop in a thread of its own, with keyframes that arrive while it solves.
TEST_F(MapperTest, InAThreadOfItsOwn) {
  std::vector<KeyframeProposal> offered;
  for (int view : {0, 2, 3, 5, 6, 7}) offered.push_back(proposal(view));
  std::jthread thread([&](std::stop_token stop) { mapper_.run(stop); });
  for (KeyframeProposal& p : offered) {
    MapperMessage message = std::move(p);
    while (!inbox_.try_push(message)) std::this_thread::yield();
    EXPECT_EQ(faults(map_, test::desk_views().camera()), "");
  }
  ResetRequest barrier;
  auto done = barrier.done.get_future();
  // Messages are taken in order: at the answer every keyframe has been.
  MapperMessage message = std::move(barrier);
  while (!inbox_.try_push(message)) std::this_thread::yield();
  done.get();
  thread.request_stop();
  thread.join();
  EXPECT_EQ(mapper_.statistics().keyframes_inserted, 6);
  EXPECT_TRUE(map_.snapshot()->empty());
}

// Stopping the thread stops a long solve: the join returns.
TEST_F(MapperTest, StopsInTheMiddleOfASolve) {
  std::jthread thread([&](std::stop_token stop) { mapper_.run(stop); });
  push(proposal(2));
  push(proposal(5));
  while (map_.snapshot()->keyframes.size() < 4) std::this_thread::yield();
  thread.request_stop();
  thread.join();
  EXPECT_EQ(faults(map_, test::desk_views().camera()), "");
}

}  // namespace
}  // namespace parallax
