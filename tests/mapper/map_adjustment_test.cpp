#include "mapper/map_adjustment.h"

#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "map/messages.h"
#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;
using test::faults;
using test::reprojection_rms;

const Map& exact_map() {
  static const Map m = test::true_map(&desk_views(), {0, 1, 2, 3, 4, 5, 6, 7}, 25);
  return m;
}

// Poses off by a few millimetres and points by a few too, the fixed keyframe excepted.
Map disturbed(double size = 0.003) {
  Map map = exact_map();
  std::mt19937 rng(1);
  std::normal_distribution<double> n(0, size);
  for (Keyframe& kf : map.keyframes) {
    if (kf.fixed) continue;
    Vector6d mu;
    for (int i = 0; i < 6; ++i) mu[i] = n(rng);
    kf.camera_from_world = RigidTransform::exp(mu) * kf.camera_from_world;
  }
  for (MapPoint& p : map.points) p.position += Eigen::Vector3d(n(rng), n(rng), n(rng));
  return map;
}

TEST(MapAdjustment, GlobalBringsTheMapBack) {
  SharedMap shared;
  test::set_map(&shared, disturbed());
  const double before = reprojection_rms(test::copy_of(shared), desk_views().camera());
  ASSERT_GT(before, 1.0);
  MapperOptions options;
  options.global_iterations = 60;
  const AdjustmentReport report = adjust_global(&shared, desk_views().camera(), options, {});
  EXPECT_TRUE(report.ran);
  EXPECT_FALSE(report.solve.failed);
  EXPECT_FALSE(report.solve.stopped);
  EXPECT_EQ(report.poses, 7) << "all but the datum";
  const Map after = test::copy_of(shared);
  EXPECT_EQ(faults(after, desk_views().camera()), "");
  EXPECT_LT(reprojection_rms(after, desk_views().camera()), 0.02 * before);
  EXPECT_TRUE(report.suspicious.empty());
  EXPECT_EQ(after.keyframes.at({0, 0}).camera_from_world.t, exact_map().keyframes.at({0, 0}).camera_from_world.t);
  // But for the scale, which no mono map knows, it is the truth.
  const auto centre = [](const Map& m, int i) { return m.keyframes.at({0, i}).centre(); };
  const double scale =
      (centre(exact_map(), 7) - centre(exact_map(), 0)).norm() / (centre(after, 7) - centre(after, 0)).norm();
  EXPECT_NEAR(scale, 1.0, 0.03);
  for (int i = 1; i < 8; ++i) {
    const Eigen::Vector3d scaled = centre(after, 0) + scale * (centre(after, i) - centre(after, 0));
    EXPECT_LT((scaled - centre(exact_map(), i)).norm(), 0.0005);
  }
}

TEST(MapAdjustment, LocalMovesOnlyWhatEquation11Says) {
  SharedMap shared;
  test::set_map(&shared, disturbed());
  MapperOptions options;
  options.local_keyframes = 3;
  const Map before = test::copy_of(shared);
  const KeyframeId newest{0, 7};
  const AdjustmentReport report = adjust_local(&shared, desk_views().camera(), options, newest, {});
  const Map after = test::copy_of(shared);
  EXPECT_EQ(faults(after, desk_views().camera()), "");
  EXPECT_EQ(report.poses, 3);
  const std::set<KeyframeId> moving = {{0, 5}, {0, 6}, {0, 7}};  // the newest and its nearest two
  for (const Keyframe& kf : before.keyframes) {
    const bool moved = after.keyframes.at(kf.id).camera_from_world.t != kf.camera_from_world.t;
    EXPECT_EQ(moved, moving.contains(kf.id)) << kf.id.index;
  }
  int moved_points = 0, still = 0;
  for (const MapPoint& p : before.points) {
    const MapPoint* now = after.points.find(p.id);
    if (!now) continue;
    bool seen = false;
    for (KeyframeId id : p.observers) seen = seen || moving.contains(id);
    if (!seen || p.observers.size() < 2) {
      EXPECT_EQ(now->position, p.position) << "no moving keyframe sees it";
      ++still;
    } else {
      ++moved_points;
    }
  }
  EXPECT_GT(moved_points, 50);
  EXPECT_GT(still, 5);
  // Every keyframe that sees such a point had its say.
  int observations = 0;
  for (const MapPoint& p : before.points) {
    bool seen = false;
    for (KeyframeId id : p.observers) seen = seen || moving.contains(id);
    if (seen && p.observers.size() >= 2) observations += static_cast<int>(p.observers.size());
  }
  EXPECT_EQ(report.observations, observations);
  EXPECT_LT(reprojection_rms(after, desk_views().camera()), reprojection_rms(before, desk_views().camera()));
}

TEST(MapAdjustment, OutliersAreTakenOutAndReported) {
  Map map = exact_map();
  // Three kinds: a measurement among many, a point's own root, and one of only two.
  std::vector<PointId> among, root, of_two;
  for (const MapPoint& p : map.points) {
    if (p.observers.size() >= 5 && among.size() < 6) {
      among.push_back(p.id);
    } else if (p.observers.size() >= 5 && root.size() < 4) {
      root.push_back(p.id);
    } else if (p.observers.size() >= 3 && of_two.size() < 4 && p.observers.size() < 5) {
      of_two.push_back(p.id);
    }
  }
  ASSERT_EQ(among.size(), 6U);
  ASSERT_EQ(root.size(), 4U);
  std::set<std::pair<KeyframeId, PointId>> spoilt;
  const auto inward = [](const Eigen::Vector2d& px) { return px.x() < 160 ? 25.0 : -25.0; };
  for (PointId id : among) {
    const MapPoint& p = map.points.at(id);
    const KeyframeId kf = p.observers.back() == p.source ? p.observers.front() : p.observers.back();
    Measurement& m = *map.keyframes.at(kf).find(id);
    m.pixel.x() += inward(m.pixel) * level_scale(m.level);
    spoilt.insert({kf, id});
  }
  for (PointId id : root) {
    Measurement& m = *map.keyframes.at(map.points.at(id).source).find(id);
    m.pixel.x() += inward(m.pixel) * level_scale(m.level);
  }
  for (PointId id : of_two) {
    const std::vector<KeyframeId> observers = map.points.at(id).observers;
    int kept = 0;
    for (KeyframeId kf : observers)
      if (kf != map.points.at(id).source && ++kept > 1) map.remove_measurement(kf, id);
    const KeyframeId other =
        map.points.at(id).observers[map.points.at(id).observers[0] == map.points.at(id).source ? 1 : 0];
    // Off the epipolar line, so that no depth explains it.
    Measurement& m = *map.keyframes.at(other).find(id);
    m.pixel.y() += (m.pixel.y() < 120 ? 25 : -25) * level_scale(m.level);
  }
  SharedMap shared;
  test::set_map(&shared, map);
  const AdjustmentReport report = adjust_global(&shared, desk_views().camera(), MapperOptions(), {});
  const Map after = test::copy_of(shared);
  EXPECT_EQ(faults(after, desk_views().camera()), "");
  const std::set<std::pair<KeyframeId, PointId>> reported(report.outliers.begin(), report.outliers.end());
  for (const auto& [kf, id] : spoilt) {
    EXPECT_TRUE(reported.contains({kf, id}));
    EXPECT_TRUE(after.points.contains(id));
    EXPECT_EQ(after.keyframes.at(kf).find(id), nullptr);
  }
  for (PointId id : root) EXPECT_FALSE(after.points.contains(id)) << "its own pixel contradicts it";
  for (PointId id : of_two) EXPECT_FALSE(after.points.contains(id)) << "one view would be left";
  EXPECT_LT(report.points_erased, 30);
  EXPECT_TRUE(report.suspicious.empty());
}

TEST(MapAdjustment, AKeyframeThatContradictsTheMapIsSuspicious) {
  Map map = exact_map();
  const KeyframeId wrong{0, 4};
  // Its measurements are those of a picture that was taken for another: scattered.
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> x(10, 310), y(10, 230);
  int k = 0;
  for (Measurement& m : map.keyframes.at(wrong).measurements)
    if (m.source != MeasurementSource::root && ++k % 5 != 0) m.pixel = Eigen::Vector2d(x(rng), y(rng));
  SharedMap shared;
  test::set_map(&shared, map);
  const AdjustmentReport report = adjust_global(&shared, desk_views().camera(), MapperOptions(), {});
  EXPECT_EQ(report.suspicious, (std::vector<KeyframeId>{wrong}));
  EXPECT_EQ(faults(shared, desk_views().camera()), "");
}

TEST(MapAdjustment, AStoppedSolveTakesNothingOut) {
  SharedMap shared;
  test::set_map(&shared, disturbed());
  const Map before = test::copy_of(shared);
  std::stop_source stop;
  stop.request_stop();
  const AdjustmentReport report = adjust_global(&shared, desk_views().camera(), MapperOptions(), stop.get_token());
  EXPECT_TRUE(report.solve.stopped);
  EXPECT_TRUE(report.outliers.empty());
  EXPECT_TRUE(report.suspicious.empty());
  const Map after = test::copy_of(shared);
  EXPECT_EQ(faults(after, desk_views().camera()), "");
  EXPECT_EQ(after.points.size(), before.points.size());
}

TEST(MapAdjustment, AnArrivingKeyframeInterruptsTheSolve) {
  SharedMap shared;
  test::set_map(&shared, disturbed(0.01));
  MapperInbox inbox(4);
  MapperOptions options;
  options.global_iterations = 1000;
  {
    const std::stop_token token = inbox.interrupt_token();
    std::jthread tracker([&] {
      MapperMessage message = KeyframeProposal();
      inbox.try_push(message);
    });
    tracker.join();
    EXPECT_TRUE(adjust_global(&shared, desk_views().camera(), options, token).solve.stopped);
    EXPECT_TRUE(adjust_local(&shared, desk_views().camera(), options, {0, 7}, inbox.interrupt_token()).solve.stopped)
        << "it still waits";
  }
  ASSERT_TRUE(inbox.try_pop());
  MapperMessage counts = PointCounts();
  ASSERT_TRUE(inbox.try_push(counts));
  EXPECT_FALSE(adjust_global(&shared, desk_views().camera(), options, inbox.interrupt_token()).solve.stopped)
      << "counts can wait";
}

// Points and a keyframe go while a solve is under way; what comes back must not bring them back.
TEST(MapAdjustment, CommitDropsWhatWasDeletedMeanwhile) {
  for (int round = 0; round < 3; ++round) {
    SharedMap shared;
    test::set_map(&shared, disturbed(0.01));
    std::atomic<bool> started = false;
    std::vector<PointId> erased;
    AdjustmentReport report;
    {
      std::jthread mapper([&] {
        MapperOptions options;
        options.global_iterations = 40;
        started = true;
        report = adjust_global(&shared, desk_views().camera(), options, {});
      });
      while (!started) std::this_thread::yield();
      for (int i = 3; i < 150; i += 7) {
        shared.write([&](Map& m) {
          if (m.points.contains({0, i})) erased.push_back({0, i});
          m.erase_point({0, i});
        });
      }
      shared.write([&](Map& m) {
        // A keyframe goes with the points it is the source of.
        std::vector<PointId> own;
        for (const MapPoint& p : m.points)
          if (p.source == KeyframeId{0, 5}) own.push_back(p.id);
        for (PointId p : own) {
          m.erase_point(p);
          erased.push_back(p);
        }
        m.erase_keyframe({0, 5});
      });
    }
    const Map after = test::copy_of(shared);
    EXPECT_EQ(faults(after, desk_views().camera()), "");
    EXPECT_FALSE(after.keyframes.contains({0, 5}));
    for (PointId p : erased) EXPECT_FALSE(after.points.contains(p));
    for (const auto& [kf, p] : report.outliers) EXPECT_FALSE(kf == (KeyframeId{0, 5}));
    EXPECT_LT(reprojection_rms(after, desk_views().camera()), 2.0);
  }
}

TEST(MapAdjustment, NothingToAdjustIsSaidSo) {
  SharedMap shared;
  EXPECT_FALSE(adjust_global(&shared, desk_views().camera(), MapperOptions(), {}).ran);
  EXPECT_FALSE(adjust_local(&shared, desk_views().camera(), MapperOptions(), {0, 0}, {}).ran);
  test::set_map(&shared, exact_map());
  EXPECT_FALSE(adjust_local(&shared, desk_views().camera(), MapperOptions(), {0, 99}, {}).ran)
      << "a keyframe that is gone";
}

}  // namespace
}  // namespace parallax
