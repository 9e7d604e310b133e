#include "mapper/keyframe_matching.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

// The desk seen in a row of views, as mapped from two sides: the second map has a world of its own, and both know their
// points to a few parts in a thousand of the depth.
std::vector<RigidTransform> around(double x, double turn, double distance) {
  std::vector<RigidTransform> out;
  for (int i = 0; i < 4; ++i) out.push_back(test::above_desk(x + 0.04 * i, turn, distance));
  return out;
}

const SimilarityTransform& other_world() {
  static const SimilarityTransform t(2.3, exp_so3({0.7, -1.1, 0.4}), {0.5, -1.2, 3.0});
  return t;
}

void add_noise(Map* map, unsigned seed, double part = 0.003) {
  std::mt19937_64 rng(seed);
  std::normal_distribution<double> n(0, 1);
  for (Keyframe& kf : map->keyframes)
    for (Measurement& m : kf.measurements) m.pixel += 0.2 * m.sigma_px * Eigen::Vector2d(n(rng), n(rng));
  for (MapPoint& p : map->points) {
    const Eigen::Vector3d centre = map->keyframes.at(p.source).centre();
    p.position += part * n(rng) * (p.position - centre);
  }
}

Map first_map() {
  static test::RenderedViews views(around(-0.1, 0, 0.68));
  Map map = test::true_map(&views, {0, 1, 2, 3});
  add_noise(&map, 1);
  return map;
}

// As seen elsewhere, in a world of its own.
Map second_map(double x, double turn, double distance, const std::string& scene = "desk") {
  test::RenderedViews views(around(x, turn, distance), scene);
  Map map = test::true_map(&views, {0, 1, 2, 3});
  add_noise(&map, 2);
  map.transform_world(other_world().inverse());
  return map;
}

// Pairs whose points are one place, to what the corners of either were placed by: a pixel of their level.
int right_pairs(const Map& a, const Map& b, const PlaceAlignment& found, const SimilarityTransform& truth) {
  int right = 0;
  for (const PointPair& pair : found.pairs) {
    const MapPoint &pa = a.points.at(pair.a), &pb = b.points.at(pair.b);
    const double depth = (a.keyframes.at(pa.source).centre() - pa.position).norm();
    const double size = std::max(level_scale(pa.source_level), level_scale(pb.source_level));
    const double pixel = depth / test::small_camera().mean_focal_px();
    if ((pa.position - truth * pb.position).norm() < 2 * size * pixel + 0.01 * depth) ++right;
  }
  return right;
}

TEST(KeyframeMatching, AligningFindsTheTransformAndTheRightPairs) {
  const Map a = first_map();
  int inliers = 0, right = 0;
  struct Case {
    double x, turn, distance;
  };
  for (const Case& c :
       {Case{-0.08, 0.05, 0.68}, Case{-0.05, 0.3, 0.6}, Case{-0.12, -0.3, 0.85}, Case{-0.1, 0.0, 0.5}}) {
    SCOPED_TRACE(::testing::Message() << c.x << ' ' << c.turn << ' ' << c.distance);
    const Map b = second_map(c.x, c.turn, c.distance);
    std::mt19937_64 rng(1);
    const auto found = align_places(a, {0, 1}, b, {0, 1}, test::small_camera(), {}, &rng);
    ASSERT_TRUE(found);
    const SimilarityTransform& truth = other_world();
    EXPECT_NEAR(found->a_from_b.s / truth.s, 1, 0.01);
    EXPECT_LT(log_so3(found->a_from_b.R * truth.R.transpose()).norm(), 0.006);
    // Where the maps are, not at the far origin of the other world.
    const Eigen::Vector3d centre = b.keyframes.at({0, 1}).centre();
    EXPECT_LT((found->a_from_b * centre - truth * centre).norm(), 0.006);
    EXPECT_EQ(found->inliers, static_cast<int>(found->pairs.size()));
    inliers += found->inliers;
    right += right_pairs(a, b, *found, truth);
    EXPECT_GE(found->inliers, 40);
    EXPECT_LT(found->sigma_px, 4);
    std::set<PointId> in_a, in_b;
    for (const PointPair& pair : found->pairs) {
      EXPECT_TRUE(in_a.insert(pair.a).second);
      EXPECT_TRUE(in_b.insert(pair.b).second);
    }
    // The other way round it is the inverse.
    const auto back = align_places(b, {0, 1}, a, {0, 1}, test::small_camera(), {}, &rng);
    ASSERT_TRUE(back);
    const SimilarityTransform round = back->a_from_b * found->a_from_b;
    EXPECT_NEAR(round.s, 1, 0.01);
    EXPECT_LT(log_so3(round.R).norm(), 0.006);
  }
  EXPECT_GE(right, 0.98 * inliers);
}

TEST(KeyframeMatching, AKnownScaleIsKept) {
  const Map a = first_map();
  Map b = second_map(-0.05, 0.1, 0.65);
  b.transform_world(SimilarityTransform(other_world().s, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()));
  PlaceAlignmentOptions options;
  options.fixed_scale = 1.0;
  std::mt19937_64 rng(1);
  const auto found = align_places(a, {0, 1}, b, {0, 1}, test::small_camera(), options, &rng);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->a_from_b.s, 1.0);
  EXPECT_LT(log_so3(found->a_from_b.R * other_world().R.transpose()).norm(), 0.006);
  options.fixed_scale = 1.6;
  EXPECT_FALSE(align_places(a, {0, 1}, b, {0, 1}, test::small_camera(), options, &rng)) << "a wrong scale";
}

// Two passes over one desk in one map, the second in a world that has drifted.
TEST(KeyframeMatching, ALoopIsFoundFromWhatIsNotShared) {
  Map map = first_map();
  const Map second = second_map(-0.07, 0.1, 0.7);
  std::mt19937_64 rng(1);
  EXPECT_FALSE(align_places(map, {0, 0}, map, {0, 3}, test::small_camera(), {}, &rng))
      << "points that both sides share are no evidence";
  std::vector<KeyframeId> ids;
  for (Keyframe kf : second.keyframes) {
    kf.measurements.clear();
    kf.fixed = false;
    ids.push_back(map.keyframes.insert(std::move(kf)));
  }
  for (MapPoint p : second.points) {
    const PointId old = p.id;
    const std::vector<KeyframeId> observers = p.observers;
    p.source = ids[static_cast<std::size_t>(p.source.index)];
    p.observers.clear();
    const PointId id = map.points.insert(std::move(p));
    for (KeyframeId observer : observers) {
      Measurement m = *second.keyframes.at(observer).find(old);
      m.point = id;
      map.add_measurement(ids[static_cast<std::size_t>(observer.index)], m);
    }
  }
  const auto found = align_places(map, {0, 1}, map, ids[1], test::small_camera(), {}, &rng);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->a_from_b.s / other_world().s, 1, 0.01);
  EXPECT_GE(right_pairs(map, map, *found, other_world()), 0.98 * found->inliers);
}

TEST(KeyframeMatching, OtherPlacesAreRefused) {
  const Map a = first_map();
  std::mt19937_64 rng(1);
  for (const char* scene : {"room", "walls"}) {
    const Map b = second_map(-0.08, 0.05, 0.68, scene);
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k)
        EXPECT_FALSE(align_places(a, {0, i}, b, {0, k}, test::small_camera(), {}, &rng)) << scene;
  }
  EXPECT_FALSE(align_places(a, {0, 9}, a, {0, 0}, test::small_camera(), {}, &rng)) << "no such keyframe";
}

// Tiles over and over: either nothing, or the truth.
TEST(KeyframeMatching, RepeatedTextureIsNeverTakenForAnotherOfItsTiles) {
  test::RenderedViews first(around(-0.1, 0, 0.68), "repeat");
  Map a = test::true_map(&first, {0, 1, 2, 3});
  add_noise(&a, 1);
  std::mt19937_64 rng(1);
  for (const auto& [x, turn] : {std::pair(-0.09, 0.02), std::pair(0.12, 0.1), std::pair(0.3, 0.0)}) {
    const Map b = second_map(x, turn, 0.7, "repeat");
    for (int i = 0; i < 4; ++i) {
      const auto found = align_places(a, {0, i}, b, {0, 3 - i}, test::small_camera(), {}, &rng);
      if (!found) continue;
      const Eigen::Vector3d centre = b.keyframes.at({0, 3 - i}).centre();
      EXPECT_LT((found->a_from_b * centre - other_world() * centre).norm(), 0.01) << x << ' ' << i;
    }
  }
}

TEST(KeyframeMatching, OptionsOutOfRangeAreNamed) {
  PlaceAlignmentOptions options;
  options.min_inliers = 3;
  EXPECT_THROW(options.validate(), InputError);
  options = {};
  options.fixed_scale = -1.0;
  EXPECT_THROW(options.validate(), InputError);
}

}  // namespace
}  // namespace parallax
