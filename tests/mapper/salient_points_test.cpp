#include "mapper/salient_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

TEST(SalientPoints, KeepTheRules) {
  const FrameImages& images = *desk_views().images(2);
  const MapperOptions options;
  // Some of the first answer is taken as measured, as a keyframe has it.
  const auto all = find_salient_points(images, {}, options);
  std::vector<Measurement> measured;
  for (std::size_t i = 0; i < all.size(); i += 3) {
    Measurement m;
    m.pixel = level_to_level0(all[i].pixel, all[i].level);
    m.level = static_cast<std::int8_t>(all[i].level);
    measured.push_back(m);
  }
  const auto points = find_salient_points(images, measured, options);
  ASSERT_GT(points.size(), 80U);
  std::array<int, kPyramidLevels> count{};
  std::array<double, kPyramidLevels> first{};
  int last_level = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SalientPoint& p = points[i];
    ASSERT_GE(p.level, last_level) << "levels in ascending order";
    last_level = p.level;
    const auto l = static_cast<std::size_t>(p.level);
    const GreyImage& image = images.pyramid.level[l];
    if (count[l]++ == 0) first[l] = p.score;
    EXPECT_LE(p.score, first[l]) << "the best comes first";
    const int x = static_cast<int>(p.pixel.x()), y = static_cast<int>(p.pixel.y());
    EXPECT_EQ(p.pixel, Eigen::Vector2d(x, y));
    EXPECT_GE(p.score, options.min_shi_tomasi[l]);
    EXPECT_NEAR(p.score, shi_tomasi_score(image, x, y), 1e-9);
    EXPECT_TRUE(std::find(images.corners[l].corners.begin(), images.corners[l].corners.end(),
                          Corner{static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)}) !=
                images.corners[l].corners.end());
    // A search patch fits around it.
    EXPECT_TRUE(x >= 5 && y >= 5 && x < image.cols - 5 && y < image.rows - 5);
    for (std::size_t j = 0; j < i; ++j) {
      if (points[j].level != p.level) continue;
      EXPECT_GE((points[j].pixel - p.pixel).norm(), options.min_spacing_px);
    }
    for (const Measurement& m : measured) {
      if (m.level != p.level) continue;
      EXPECT_GE((level0_to_level(m.pixel, p.level) - p.pixel).norm(), options.min_spacing_px - 0.75);
    }
  }
  const double area = 320.0 * 240.0 / (640.0 * 480.0);
  for (std::size_t l = 0; l < kPyramidLevels; ++l) EXPECT_LE(count[l], std::max(5.0, options.max_new_points[l] * area));
}

TEST(SalientPoints, AreSpreadOverTheImageWhenFewMayBeTaken) {
  const FrameImages& images = *desk_views().images(2);
  MapperOptions options;
  for (int& n : options.max_new_points) n = 160;  // 40 at this size
  const auto points = find_salient_points(images, {}, options);
  std::set<int> cells;
  int level0 = 0;
  for (const SalientPoint& p : points) {
    if (p.level != 0) continue;
    ++level0;
    cells.insert(static_cast<int>(p.pixel.y() / 16) * 100 + static_cast<int>(p.pixel.x() / 16));
  }
  EXPECT_EQ(level0, 40);
  EXPECT_EQ(cells.size(), 40U) << "every cell gives its best before any gives its second";
}

TEST(SalientPoints, AMeasurementOfAFarLevelIsNotInTheWay) {
  const FrameImages& images = *desk_views().images(2);
  const MapperOptions options;
  const auto all = find_salient_points(images, {}, options);
  std::vector<Measurement> coarse;
  for (const SalientPoint& p : all) {
    if (p.level != 0) continue;
    Measurement m;
    m.pixel = p.pixel;
    m.level = 3;
    coarse.push_back(m);
  }
  const auto level0 = [](const std::vector<SalientPoint>& points) {
    return std::count_if(points.begin(), points.end(), [](const SalientPoint& p) { return p.level == 0; });
  };
  EXPECT_EQ(level0(find_salient_points(images, coarse, options)), level0(all));
}

TEST(SalientPoints, ABlankImageHasNone) {
  const auto blank = test::features_of(GreyImage(240, 320, static_cast<std::uint8_t>(90)));
  EXPECT_TRUE(find_salient_points(*blank, {}, MapperOptions()).empty());
}

}  // namespace
}  // namespace parallax
