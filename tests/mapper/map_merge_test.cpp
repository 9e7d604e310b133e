#include "mapper/map_merge.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <stop_token>
#include <string>
#include <vector>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

std::shared_ptr<const Vocabulary> shipped_words() {
  static const auto words = std::make_shared<const Vocabulary>(
      Vocabulary::load(std::string(PARALLAX_SOURCE_DIR) + "/assets/vocabulary/places.plxvoc"));
  return words;
}

// A session at the desk: four views, a plane, and a label on the table at `label` (metres of the true world); its world
// is its own.
MapDocument desk_session(double x, double turn, const Eigen::Vector3d& label, const SimilarityTransform& own_from_true,
                         unsigned seed, const std::string& scene = "desk", double light = 1) {
  std::vector<RigidTransform> poses;
  for (int i = 0; i < 4; ++i) poses.push_back(test::above_desk(x + 0.05 * i, turn, 0.68));
  test::RenderedViews views(poses, scene, 1.0, test::small_camera(), light);
  MapDocument out;
  out.map = test::true_map(&views, {0, 1, 2, 3}, 100);
  std::mt19937_64 rng(seed);
  std::normal_distribution<double> n(0, 1);
  for (Keyframe& kf : out.map.keyframes)
    for (Measurement& m : kf.measurements) m.pixel += 0.15 * m.sigma_px * Eigen::Vector2d(n(rng), n(rng));
  for (MapPoint& p : out.map.points)
    p.position += 0.002 * n(rng) * (p.position - out.map.keyframes.at(p.source).centre());
  out.map.planes.push_back({RigidTransform(Eigen::Matrix3d::Identity(), {x, 0, 0}), 0.3});
  out.map.plane = out.map.planes.front();
  ContentItem item;
  item.id = 1;
  item.text = "label " + std::to_string(seed);
  item.world_from_item = SimilarityTransform(1, Eigen::Matrix3d::Identity(), label);
  out.calibration = "of " + std::to_string(seed);
  out.map.transform_world(own_from_true);
  item.world_from_item = own_from_true * item.world_from_item;
  out.content.push_back(item);
  return out;
}

const Eigen::Vector3d kLabelOfA(-0.05, 0.05, 0), kLabelOfB(0.1, 0.1, 0);
const SimilarityTransform& world_of_b() {
  static const SimilarityTransform t(1.8, exp_so3({0.4, -0.7, 1.0}), {0.3, -0.2, 0.5});
  return t;
}
const MapDocument& session_a() {
  static const MapDocument a = desk_session(-0.12, 0, kLabelOfA, {}, 1);
  return a;
}
const MapDocument& session_b() {
  static const MapDocument b = desk_session(-0.02, 0.12, kLabelOfB, world_of_b(), 2);
  return b;
}

MapMergeResult merged(const MapDocument& a, const MapDocument& b) {
  return merge_maps(a, b, test::small_camera(), shipped_words(), MapMergeOptions());
}

// The world of a document to the true one, by the points of the session that was its base: their errors are many and
// even.
SimilarityTransform true_from(const MapDocument& document, const MapDocument& base,
                              const SimilarityTransform& own_from_true) {
  std::vector<Eigen::Vector3d> from, to;
  for (const MapPoint& p : base.map.points) {
    const MapPoint* now = document.map.points.find(p.id);
    if (!now) continue;
    from.push_back(now->position);
    to.push_back(own_from_true.inverse() * p.position);
  }
  Eigen::Matrix3Xd src(3, from.size()), dst(3, to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    src.col(static_cast<Eigen::Index>(i)) = from[i];
    dst.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  SimilarityTransform out;
  EXPECT_TRUE(align_points(src, dst, true, &out));
  return out;
}

TEST(MapMerge, TwoSessionsOfOneDeskBecomeOne) {
  MapDocument a = session_a(), b = session_b();
  a.games["marbles"] = "a's";
  b.games["marbles"] = "b's";
  b.games["swarm"] = "b's";
  const MapMergeResult result = merged(a, b);
  ASSERT_TRUE(result.merged) << result.reason;
  const MapDocument& all = result.document;
  EXPECT_EQ(test::faults(all.map, test::small_camera()), "");
  EXPECT_EQ(all.map.keyframes.size(), 8);
  EXPECT_GT(result.points_fused, 100);
  EXPECT_GT(result.common_points, 150);
  EXPECT_LT(all.map.points.size(), a.map.points.size() + b.map.points.size() - 100);
  EXPECT_EQ(all.map.planes.size(), 1U) << "one table";
  EXPECT_EQ(all.games.at("marbles"), "a's");
  EXPECT_EQ(all.games.at("swarm"), "b's");
  EXPECT_EQ(all.calibration, a.calibration);
  int datums = 0;
  for (const Keyframe& kf : all.map.keyframes) datums += kf.fixed;
  EXPECT_EQ(datums, 1);
  EXPECT_NEAR(result.base_from_other.s * world_of_b().s, 1, 0.01);
  EXPECT_EQ(result.document_from_base.s, 1.0);

  ASSERT_EQ(all.content.size(), 2U);
  EXPECT_EQ(all.content[0].id, 1);
  EXPECT_EQ(all.content[1].id, 2) << "a fresh identifier";
  const SimilarityTransform truth = true_from(all, a, {});
  EXPECT_LT((truth * all.content[0].position() - kLabelOfA).norm(), 0.005);
  EXPECT_LT((truth * all.content[1].position() - kLabelOfB).norm(), 0.005);
  // b's cameras stand where they stood.
  for (const Keyframe& kf : b.map.keyframes) {
    const Eigen::Vector3d now = truth * all.map.keyframes.at({0, 4 + kf.id.index}).centre();
    EXPECT_LT((now - world_of_b().inverse() * kf.centre()).norm(), 0.005);
  }
}

// The other session saw the desk by 60 percent of the light.
TEST(MapMerge, AnotherLightIsNoOtherPlace) {
  const MapDocument dim = desk_session(-0.02, 0.12, kLabelOfB, world_of_b(), 2, "desk", 0.6);
  const MapMergeResult same = merged(session_a(), session_b()), result = merged(session_a(), dim);
  ASSERT_TRUE(same.merged && result.merged) << result.reason;
  std::printf("found of what was looked for: %.2f, %.2f in the same light\n", result.found_part, same.found_part);
  EXPECT_GT(result.found_part, 0.8 * same.found_part);
  EXPECT_GT(result.common_points, 0.8 * same.common_points);
  const SimilarityTransform truth = true_from(result.document, session_a(), {});
  EXPECT_LT((truth * result.document.content[1].position() - kLabelOfB).norm(), 0.005);
}

TEST(MapMerge, TheOtherWayRoundItIsTheSameMap) {
  const MapMergeResult ab = merged(session_a(), session_b()), ba = merged(session_b(), session_a());
  ASSERT_TRUE(ab.merged && ba.merged) << ab.reason << ba.reason;
  const SimilarityTransform true_from_ab = true_from(ab.document, session_a(), {});
  const SimilarityTransform true_from_ba = true_from(ba.document, session_b(), world_of_b());
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d one = true_from_ab * ab.document.map.keyframes.at({0, i}).centre();
    const Eigen::Vector3d two = true_from_ba * ba.document.map.keyframes.at({0, (i + 4) % 8}).centre();
    EXPECT_LT((one - two).norm(), 0.004) << i;
  }
}

TEST(MapMerge, AKnownScaleIsTakenFromWhoeverKnowsIt) {
  MapDocument a = session_a(), b = session_b();
  a.scale_is_known = true;
  MapMergeResult result = merged(a, b);
  ASSERT_TRUE(result.merged) << result.reason;
  EXPECT_TRUE(result.document.scale_is_known);
  EXPECT_EQ(result.document_from_base.s, 1.0);
  a.scale_is_known = false;
  b.scale_is_known = true;  // of its own metres, 1.8 of the true ones
  result = merged(a, b);
  ASSERT_TRUE(result.merged) << result.reason;
  EXPECT_TRUE(result.document.scale_is_known);
  EXPECT_NEAR(result.document_from_base.s, world_of_b().s, 0.02);
  EXPECT_NEAR(result.document_from_other.s, 1, 1e-9);
  EXPECT_NEAR(result.document.content[0].world_from_item.s, world_of_b().s, 0.03);
  EXPECT_EQ(test::faults(result.document.map, test::small_camera()), "");
  a.scale_is_known = true;
  result = merged(a, b);
  EXPECT_FALSE(result.merged) << "the two scales are 1.8 apart";
  EXPECT_NE(result.reason.find("scales"), std::string::npos) << result.reason;
}

TEST(MapMerge, WithItselfAMapKeepsItsShape) {
  const MapMergeResult result = merged(session_a(), session_a());
  ASSERT_TRUE(result.merged) << result.reason;
  EXPECT_NEAR(result.base_from_other.s, 1, 0.003);
  EXPECT_EQ(result.document.content.size(), 1U) << "what is in both is there once";
  const SimilarityTransform truth = true_from(result.document, session_a(), {});
  EXPECT_LT((truth * result.document.content[0].position() - kLabelOfA).norm(), 0.004);
}

TEST(MapMerge, OtherPlacesAndEmptyMapsAreRefused) {
  for (const char* scene : {"room", "walls"}) {
    const MapMergeResult result = merged(session_a(), desk_session(-0.02, 0.1, kLabelOfB, {}, 3, scene));
    EXPECT_FALSE(result.merged) << scene;
    EXPECT_FALSE(result.reason.empty());
    EXPECT_TRUE(result.document.map.empty());
  }
  EXPECT_EQ(merged(session_a(), {}).reason, "one of the maps is empty");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(merge_maps(session_a(), session_b(), test::small_camera(), shipped_words(), {}, stop.get_token()).reason,
            "interrupted");
}

}  // namespace
}  // namespace parallax
