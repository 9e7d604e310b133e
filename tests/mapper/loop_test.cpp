// A room walked round and back to the start, whose map has drifted: found, closed, and what is on it stays put. And
// places that only look alike, where nothing is closed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "map/content.h"
#include "mapper/mapper.h"
#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

constexpr int kViews = 22, kRound = 20;  // 18 degrees apart; 20 and 21 look where 0 and 1 did

std::vector<RigidTransform> circle() {
  std::vector<RigidTransform> out;
  for (int i = 0; i < kViews + 1; ++i) {
    const double angle = 2 * M_PI * (i < kViews ? i : kViews - 0.5) / kRound;
    const double radius = 0.7 + (i < kRound ? 0.0 : 0.05);
    const Eigen::Vector3d out_of(std::sin(angle), std::cos(angle), 0);
    const Eigen::Vector3d eye = radius * out_of + Eigen::Vector3d(0, 0, 1.3 + 0.02 * (i % 3));
    out.push_back(look_at(eye, eye + out_of - Eigen::Vector3d(0, 0, 0.12)));
  }
  return out;
}

test::RenderedViews& room_views() {
  static test::RenderedViews views(circle(), "room");
  return views;
}

// What is seen on both sides of the loop is there twice, as it is in a map that has drifted.
void take_sides_apart(Map* map, const CameraModel& camera) {
  std::vector<PointId> both;
  for (const MapPoint& p : map->points)
    if (p.observers.front().index < kViews / 2 && p.observers.back().index - p.observers.front().index > kViews / 2)
      both.push_back(p.id);
  for (PointId id : both) {
    MapPoint twin = map->points.at(id);
    const bool new_side = twin.source.index > kViews / 2;
    std::vector<KeyframeId> others;
    for (KeyframeId kf : twin.observers)
      if ((kf.index > kViews / 2) != new_side) others.push_back(kf);
    std::vector<Measurement> measurements;
    for (KeyframeId kf : others) {
      measurements.push_back(*map->keyframes.at(kf).find(id));
      map->remove_measurement(kf, id);
    }
    if (others.size() >= 2) {
      const Measurement& root = measurements.front();
      twin.observers.clear();
      if (set_source(&twin, others.front(), root.level, level0_to_level(root.pixel, root.level), camera)) {
        const PointId made = map->points.insert(twin);
        for (std::size_t i = 0; i < others.size(); ++i) {
          Measurement m = measurements[i];
          m.point = made;
          m.source = i == 0 ? MeasurementSource::root : MeasurementSource::refind;
          map->add_measurement(others[i], m);
        }
      }
    }
    if (map->points.at(id).observers.size() < 2) map->erase_point(id);
  }
}

// How far the surroundings of a keyframe have drifted: place, direction and scale, the more the later.
SimilarityTransform drift(int keyframe) {
  const double part = std::pow(std::max(0, keyframe) / static_cast<double>(kViews), 1.2);
  return {std::exp(0.10 * part), exp_so3(part * Eigen::Vector3d(0.02, -0.03, 0.05)),
          part * Eigen::Vector3d(0.12, -0.08, 0.06)};
}

Map drifted_room() {
  std::vector<int> keyframes(kViews);
  std::iota(keyframes.begin(), keyframes.end(), 0);
  Map map = test::true_map(&room_views(), keyframes, 60);
  take_sides_apart(&map, room_views().camera());
  std::mt19937_64 rng(5);
  std::normal_distribution<double> n(0, 1);
  for (MapPoint& p : map.points) {
    const SimilarityTransform bend = drift(p.source.index);
    p.position = bend * p.position;
    p.normal = bend.R * p.normal;
  }
  for (Keyframe& kf : map.keyframes) {
    kf.camera_from_world = drift(kf.id.index).rebase(kf.camera_from_world);
    for (Measurement& m : kf.measurements) m.pixel += 0.2 * m.sigma_px * Eigen::Vector2d(n(rng), n(rng));
  }
  for (Keyframe& kf : map.keyframes) map.update_depth(&kf);
  return map;
}

const Map& drifted() {
  static const Map map = drifted_room();
  return map;
}

std::shared_ptr<const Vocabulary> words() {
  static const auto vocabulary = std::make_shared<const Vocabulary>(
      Vocabulary::load(std::string(PARALLAX_SOURCE_DIR) + "/assets/vocabulary/places.plxvoc"));
  return vocabulary;
}

// Root mean square distance of the keyframes' centres from the truth, after a similarity transform; metres.
double centre_error(const Map& map) {
  Eigen::Matrix3Xd mine(3, map.keyframes.size()), truth(3, map.keyframes.size());
  Eigen::Index i = 0;
  for (const Keyframe& kf : map.keyframes) {
    mine.col(i) = kf.centre();
    truth.col(i++) = room_views().camera_from_world(kf.frame).inverse().t;
  }
  SimilarityTransform fit;
  if (!align_points(mine, truth, true, &fit)) return INFINITY;
  double sum = 0;
  for (Eigen::Index k = 0; k < i; ++k)
    sum += (fit * Eigen::Vector3d(mine.col(k)) - truth.col(k)).squaredNorm() / static_cast<double>(i);
  return std::sqrt(sum);
}

std::optional<LoopCandidate> detect(const SharedMap& map, const CameraModel& camera, const std::vector<int>& keyframes,
                                    LoopDetectionStatistics* statistics, const LoopDetectionOptions& options = {}) {
  LoopDetection detection(words(), camera, options, 1);
  for (int k : keyframes) detection.add({0, k});
  std::optional<LoopCandidate> out;
  for (bool idle = false; !idle && !out;) out = detection.step(map, &idle);
  *statistics = detection.statistics();
  return out;
}

TEST(Loop, ADriftedRoomIsClosedAndContentStaysOnItsSurface) {
  const CameraModel& camera = room_views().camera();
  SharedMap map;
  test::set_map(&map, drifted());
  ASSERT_EQ(test::faults(map, camera), "");
  const double error = centre_error(drifted());
  ASSERT_GT(error, 0.03) << "metres of drift";

  // On what view 21 shows, where the drifted map thinks it is; and on what view 1 shows, which does not move.
  Content content;
  content.follow(*map.snapshot());
  const Eigen::Vector2d middle(160, 120);
  const Eigen::Vector3d place = *room_views().seen(kViews - 1, middle);
  content.set_seen_from({0, kViews - 1});
  const int late = content.add_label("late", drift(kViews - 1) * place, Eigen::Vector3d::UnitZ());
  content.set_seen_from({0, 1});
  const Eigen::Vector3d start = drift(1) * *room_views().seen(1, middle);
  const int early = content.add_label("early", start, Eigen::Vector3d::UnitZ());

  LoopDetectionStatistics statistics;
  const auto loop = detect(map, camera, {kRound / 2, kViews - 3, kViews - 2, kViews - 1}, &statistics);
  ASSERT_TRUE(loop);
  EXPECT_LE(loop->old_keyframe.index, 3);
  EXPECT_GE(loop->new_keyframe.index, kViews - 3);
  const SimilarityTransform expected = drift(loop->old_keyframe.index) * drift(loop->new_keyframe.index).inverse();
  EXPECT_NEAR(loop->alignment.a_from_b.s, expected.s, 0.03);

  const LoopReport report = close_loop(&map, camera, MapperOptions(), *loop, LoopClosingOptions());
  ASSERT_TRUE(report.closed) << report.reason;
  EXPECT_GT(report.points_fused, 20);
  EXPECT_NEAR(report.drift_scale, 1 / expected.s, 0.03);
  EXPECT_EQ(test::faults(map, camera), "");
  const Map closed = test::copy_of(map);
  EXPECT_LT(centre_error(closed), 0.4 * error);
  EXPECT_EQ(closed.keyframes.begin()->camera_from_world.t, drifted().keyframes.begin()->camera_from_world.t);
  EXPECT_LT(report.error_after, report.error_before + 1);

  const auto now = map.snapshot();
  content.follow(*now);
  const Keyframe& newest = closed.keyframes.at({0, kViews - 1});
  Eigen::Vector2d seen;
  ASSERT_TRUE(camera.project(newest.camera_from_world * content.find(late)->position(), &seen));
  EXPECT_LT((seen - middle).norm(), 4) << "pixels, as seen from the newer side";
  EXPECT_LT((content.find(early)->position() - start).norm(), 0.03) << "the older side stays";
  // From the older side it is now where it really is, too.
  const auto truly = room_views().project_visible(1, place, 0);
  ASSERT_TRUE(truly);
  Eigen::Vector2d from_old;
  ASSERT_TRUE(
      camera.project(closed.keyframes.at({0, 1}).camera_from_world * content.find(late)->position(), &from_old));
  EXPECT_LT((from_old - *truly).norm(), 8) << "pixels";

  // The adjustment that follows takes the rest of the drift out.
  for (int round = 0; round < 8; ++round)
    if (adjust_global(&map, camera, MapperOptions(), {}).solve.converged) break;
  EXPECT_EQ(test::faults(map, camera), "");
  EXPECT_LT(centre_error(test::copy_of(map)), 0.015) << "metres, of what was " << error;
}

TEST(Loop, AWrongLoopIsRefusedWithNothingChanged) {
  const CameraModel& camera = room_views().camera();
  SharedMap map;
  test::set_map(&map, drifted());
  const auto before = map.snapshot();
  LoopDetectionStatistics statistics;
  auto loop = detect(map, camera, {kViews - 3, kViews - 2, kViews - 1}, &statistics);
  ASSERT_TRUE(loop);
  const LoopCandidate right = *loop;
  const auto refused = [&](const LoopCandidate& wrong, const std::string& what) {
    const LoopReport report = close_loop(&map, camera, MapperOptions(), wrong, LoopClosingOptions());
    EXPECT_FALSE(report.closed) << what;
    EXPECT_FALSE(report.reason.empty()) << what;
    EXPECT_EQ(map.snapshot(), before) << what << ": nothing was published";
    EXPECT_EQ(test::copy_of(map).points.size(), drifted().points.size()) << what;
  };
  LoopCandidate wrong = right;
  wrong.alignment.a_from_b.t += Eigen::Vector3d(0.4, 0.2, 0);
  refused(wrong, "beside");
  wrong = right;
  wrong.alignment.a_from_b.s *= 4;
  refused(wrong, "much smaller");
  wrong = right;
  wrong.old_keyframe = {0, kRound / 2};
  refused(wrong, "the other side of the room");
  wrong.old_keyframe = {0, 99};
  refused(wrong, "a keyframe that is not there");
}

// Tiles over and over: two parts of a wall that share no points look the same.
TEST(Loop, PlacesThatOnlyLookAlikeAreNot) {
  std::vector<RigidTransform> poses;
  for (int part = 0; part < 2; ++part)
    for (int i = 0; i < 4; ++i) poses.push_back(test::above_desk(-0.55 + 0.75 * part + 0.03 * i, 0, 0.35));
  test::RenderedViews views(poses, "repeat");
  SharedMap map;
  test::set_map(&map, test::true_map(&views, {0, 1, 2, 3, 4, 5, 6, 7}, 80));
  LoopDetectionStatistics statistics;
  LoopDetectionOptions trusting;  // geometry alone decides
  trusting.min_similarity = trusting.min_similarity_part = 0;
  trusting.consistent = 1;
  trusting.connected_points = 100000;  // the parts share what stands behind the table
  EXPECT_FALSE(detect(map, views.camera(), {4, 5, 6, 7}, &statistics, trusting));
  EXPECT_EQ(statistics.words, 4);
  EXPECT_GT(statistics.compared, 3) << "they are compared";
  EXPECT_EQ(statistics.found, 0);
}

// The mapper does all of it by itself, when the tracker brings one more keyframe; and takes what was tracked before.
TEST(Loop, TheMapperClosesItAndRebasesWhatComesLate) {
  const CameraModel& camera = room_views().camera();
  SharedMap map;
  MapperInbox inbox(8);
  MapperOptions options;
  options.vocabulary = words();
  Mapper mapper(camera, options, &map, &inbox);
  Map known = drifted();
  test::set_map(&map, known);
  const auto proposal = [&](int view, const SimilarityTransform& bend) {
    const auto snapshot = map.snapshot();
    KeyframeProposal p;
    p.frame = view;
    p.camera_from_world = bend.rebase(room_views().camera_from_world(view));
    p.map_version = snapshot->map_version;
    p.world_version = snapshot->world_version;
    p.world = snapshot->stamp();
    p.images = room_views().images(view);
    for (std::size_t i = 0; i < snapshot->id.size(); ++i) {
      if (snapshot->keyframes[static_cast<std::size_t>(snapshot->source[i])].id.index < kViews / 2) continue;
      Eigen::Vector2d pixel;
      if (camera.project(p.camera_from_world * snapshot->position[i], &pixel) && camera.in_image(pixel, 10) &&
          (p.camera_from_world * snapshot->position[i]).z() > 0)
        p.measurements.push_back({snapshot->id[i], pixel, 1.0F, 0, MeasurementSource::tracker});
    }
    return p;
  };
  const auto settle = [&] {
    for (int steps = 0; mapper.step(); ++steps) {
      ASSERT_EQ(test::faults(map, camera), "");
      ASSERT_LT(steps, 3000);
    }
  };
  // Two of them, one after the other, and one that was on its way.
  const KeyframeProposal late = proposal(kViews - 1, drift(kViews - 1));
  MapperMessage first = proposal(kViews, drift(kViews - 1)), second = proposal(kViews, drift(kViews - 1));
  ASSERT_TRUE(inbox.try_push(first) && inbox.try_push(second));
  settle();
  EXPECT_EQ(mapper.statistics().loops_closed, 1);
  EXPECT_EQ(mapper.statistics().loops_refused, 0);
  EXPECT_EQ(map.snapshot()->warps.size(), 1U);
  MapperMessage third = late;
  ASSERT_TRUE(inbox.try_push(third));
  ASSERT_TRUE(mapper.step());
  const Map taken = test::copy_of(map);
  KeyframeId newest;
  for (const Keyframe& kf : taken.keyframes) newest = kf.id;
  ASSERT_EQ(taken.keyframes.at(newest).frame, kViews - 1);
  EXPECT_LT((taken.keyframes.at(newest).centre() - taken.keyframes.at({0, kViews - 1}).centre()).norm(), 0.03)
      << "where the same view stands in the closed map";
  settle();
  EXPECT_LT(centre_error(test::copy_of(map)), 0.02);
}

}  // namespace
}  // namespace parallax
