#include "mapper/epipolar_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

SearchView view_of(int i, double min_depth = 0.35, double max_depth = 1.4) {
  SearchView v;
  v.id = {0, i};
  v.camera_from_world = desk_views().camera_from_world(i);
  v.images = desk_views().images(i);
  v.mean_depth = 0.7;
  v.depth_sigma = 0.15;
  v.min_depth = min_depth;
  v.max_depth = max_depth;
  return v;
}

TEST(EpipolarSearch, DepthsAreTrue) {
  const MapperOptions options;
  const auto candidates = find_salient_points(*desk_views().images(3), {}, options);
  for (int second : {5, 1}) {
    const EpipolarSearch search(desk_views().camera(), options, view_of(3), view_of(second));
    std::vector<double> errors;
    int visible = 0, found_visible = 0;
    for (const SalientPoint& c : candidates) {
      const Eigen::Vector2d px = level_to_level0(c.pixel, c.level);
      const auto place = desk_views().seen(3, px);
      // The edge of a thing shows what is behind it too: only smooth places have one depth.
      const bool smooth = desk_views().normal(3, px, 4 * level_scale(c.level)).has_value();
      const auto other = place && smooth ? desk_views().project_visible(second, *place, 10) : std::nullopt;
      visible += other ? 1 : 0;
      const auto found = search.find(c);
      if (!found) continue;
      const double z = (desk_views().camera_from_world(3) * found->position).z();
      EXPECT_GE(z, 0.35);
      EXPECT_LE(z, 1.4);
      EXPECT_EQ(found->level, c.level);
      EXPECT_EQ(found->pixel, c.pixel);
      EXPECT_EQ(found->other.source, MeasurementSource::epipolar);
      EXPECT_EQ(found->other.sigma_px, level_scale(found->other.level));
      // The place projects to where it was measured.
      Eigen::Vector2d p1, p2;
      ASSERT_TRUE(desk_views().camera().project(desk_views().camera_from_world(3) * found->position, &p1));
      ASSERT_TRUE(desk_views().camera().project(desk_views().camera_from_world(second) * found->position, &p2));
      EXPECT_LT((p1 - px).norm(), options.max_triangulation_error_px * level_scale(c.level));
      EXPECT_LT((p2 - found->other.pixel).norm(), options.max_triangulation_error_px * level_scale(found->other.level));
      if (!other) continue;
      ++found_visible;
      errors.push_back(std::abs(z / desk_views().depth(3, px) - 1) / level_scale(c.level));
    }
    ASSERT_GT(visible, 40);
    EXPECT_GT(found_visible, 0.5 * visible);
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.006) << "relative, at level 0; 8 cm between the views";
    EXPECT_LT(errors[errors.size() * 95 / 100], 0.05);
  }
}

TEST(EpipolarSearch, TheDepthRangeIsALimit) {
  const MapperOptions options;
  // Nothing on the desk is this near.
  const EpipolarSearch search(desk_views().camera(), options, view_of(3, 0.1, 0.2), view_of(5));
  for (const SalientPoint& c : find_salient_points(*desk_views().images(3), {}, options)) {
    const auto found = search.find(c);
    if (!found) continue;
    const double z = (desk_views().camera_from_world(3) * found->position).z();
    EXPECT_TRUE(z >= 0.1 && z <= 0.2) << z;
  }
}

TEST(EpipolarSearch, WithoutParallaxNothingIsFound) {
  const MapperOptions options;
  SearchView same = view_of(3);
  same.id = {0, 9};
  const EpipolarSearch search(desk_views().camera(), options, view_of(3), same);
  for (const SalientPoint& c : find_salient_points(*desk_views().images(3), {}, options)) EXPECT_FALSE(search.find(c));
}

TEST(EpipolarSearch, APictureOfSomethingElseGivesNextToNothing) {
  const MapperOptions options;
  test::RenderedViews room({test::above_desk(0)}, "room");
  SearchView stranger = view_of(5);
  stranger.images = room.images(0);
  const EpipolarSearch search(desk_views().camera(), options, view_of(3), stranger);
  const auto candidates = find_salient_points(*desk_views().images(3), {}, options);
  int found = 0;
  for (const SalientPoint& c : candidates) found += search.find(c) ? 1 : 0;
  EXPECT_LT(found, 0.05 * static_cast<double>(candidates.size()));
}

}  // namespace
}  // namespace parallax
