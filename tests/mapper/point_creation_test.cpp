#include "mapper/point_creation.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

TEST(PointCreation, NewPointsAreTrueAndWhole) {
  SharedMap shared;
  test::set_map(&shared, test::true_map(&desk_views(), {1, 3, 5}, 12));
  const Map before = test::copy_of(shared);
  const KeyframeId newest{0, 2};
  const int made = create_points(&shared, desk_views().camera(), MapperOptions(), newest);
  const Map after = test::copy_of(shared);
  EXPECT_EQ(test::faults(after, desk_views().camera()), "");
  EXPECT_EQ(after.points.size(), before.points.size() + made);
  ASSERT_GT(made, 60);
  int wrong = 0, smooth = 0;
  std::array<int, kPyramidLevels> levels{};
  for (const MapPoint& p : after.points) {
    if (before.points.contains(p.id)) continue;
    ++levels[static_cast<std::size_t>(p.source_level)];
    EXPECT_EQ(p.source, newest);
    EXPECT_EQ(p.observers.size(), 2U);
    const Measurement* root = after.keyframes.at(newest).find(p.id);
    ASSERT_NE(root, nullptr);
    EXPECT_EQ(root->source, MeasurementSource::root);
    EXPECT_EQ(root->level, p.source_level);
    EXPECT_NEAR((root->pixel - level_to_level0(p.source_pixel, p.source_level)).norm(), 0, 1e-12);
    // The patch looks at its source.
    EXPECT_GT(p.normal.dot((after.keyframes.at(newest).centre() - p.position).normalized()), 0.99);
    if (!desk_views().normal(5, root->pixel, 4 * level_scale(p.source_level))) continue;
    ++smooth;
    const double z = (desk_views().camera_from_world(5) * p.position).z();
    wrong += std::abs(z / desk_views().depth(5, root->pixel) - 1) > 0.04 * level_scale(p.source_level) ? 1 : 0;
  }
  EXPECT_GT(smooth, 30);
  EXPECT_LT(wrong, 0.06 * smooth);
  EXPECT_GT(levels[0], 0);
  EXPECT_GT(levels[1], 0);
  // What was there has not changed.
  for (const MapPoint& p : before.points) EXPECT_EQ(after.points.at(p.id).position, p.position);
}

TEST(PointCreation, TheSamePlaceIsNotMadeTwice) {
  SharedMap shared;
  test::set_map(&shared, test::true_map(&desk_views(), {1, 3}, 12));
  const MapperOptions options;
  const KeyframeId newest{0, 1};
  int made = 0;
  for (int round = 0; round < 3; ++round) {
    const Map before = test::copy_of(shared);
    made += create_points(&shared, desk_views().camera(), options, newest);
    const Map after = test::copy_of(shared);
    EXPECT_EQ(test::faults(after, desk_views().camera()), "");
    for (const MapPoint& p : after.points) {
      if (before.points.contains(p.id)) continue;
      for (const Measurement& m : before.keyframes.at(newest).measurements) {
        if (std::abs(m.level - p.source_level) > 1) continue;
        EXPECT_GT((level0_to_level(m.pixel, p.source_level) - p.source_pixel).norm(), options.min_spacing_px - 0.75);
      }
    }
  }
  EXPECT_GT(made, 40);
}

TEST(PointCreation, WithoutABaselineNoneAreMade) {
  SharedMap shared;
  test::set_map(&shared, test::true_map(&desk_views(), {1}, 12));
  EXPECT_EQ(create_points(&shared, desk_views().camera(), MapperOptions(), {0, 0}), 0);
  EXPECT_EQ(create_points(&shared, desk_views().camera(), MapperOptions(), {0, 7}), 0)
      << "a keyframe that is not there";
}

}  // namespace
}  // namespace parallax
