#include "core/image.h"

#include <gtest/gtest.h>

#include "tests/core/kernel_images.h"

namespace parallax {
namespace {

TEST(PyramidLevels, PixelConversionsKeepPixelCentres) {
  // The top-left pixel of level 1 covers pixels 0 and 1 of level 0: its centre is at 0.5.
  EXPECT_EQ(level_to_level0({0, 0}, 1), Eigen::Vector2d(0.5, 0.5));
  EXPECT_EQ(level_to_level0({0, 2}, 3), Eigen::Vector2d(3.5, 19.5));
  for (int level = 0; level < kPyramidLevels; ++level) {
    const Eigen::Vector2d px(17.25, 3.5);
    EXPECT_LT((level0_to_level(level_to_level0(px, level), level) - px).norm(), 1e-12);
  }
}

TEST(Pyramid, EveryLevelIsTheRoundedBoxAverageAtEveryInstructionSet) {
  std::mt19937 random(1);
  for (const auto& [width, height, gap] : std::vector<std::array<int, 3>>{
           {640, 480, 0}, {8, 8, 0}, {9, 9, 5}, {67, 35, 0}, {129, 33, 7}, {161, 121, 1}, {1, 1, 0}, {3, 2, 0}}) {
    ExactImage base(width, height, gap);
    fill_random(&base, 0, &random);
    for_each_simd_level([&, w = width, h = height] {
      ImagePyramid pyramid;
      build_pyramid(base.image, &pyramid);
      EXPECT_EQ(pyramid.width(), w);
      EXPECT_EQ(pyramid.height(), h);
      for (std::size_t l = 1; l < kPyramidLevels; ++l) {
        const GreyImage &from = pyramid.level[l - 1], &to = pyramid.level[l];
        ASSERT_EQ(to.cols, from.cols / 2);
        ASSERT_EQ(to.rows, from.rows / 2);
        for (int y = 0; y < to.rows; ++y) {
          for (int x = 0; x < to.cols; ++x) {
            const int sum =
                from(2 * y, 2 * x) + from(2 * y, 2 * x + 1) + from(2 * y + 1, 2 * x) + from(2 * y + 1, 2 * x + 1);
            ASSERT_EQ(to(y, x), (sum + 2) / 4) << l << ": " << x << "," << y;
          }
        }
      }
    });
  }
}

TEST(Pyramid, ReusesItsMemoryOnlyWhenNobodyElseHoldsIt) {
  std::mt19937 random(2);
  ExactImage first(64, 48), second(64, 48);
  fill_random(&first, 0, &random);
  fill_random(&second, 0, &random);
  ImagePyramid pyramid;
  build_pyramid(first.image, &pyramid);
  EXPECT_EQ(pyramid.level[0].data, first.image.data) << "level 0 is shared";
  const std::uint8_t* level2 = pyramid.level[2].data;
  const ImagePyramid held = pyramid;
  const GreyImage before = held.level[2].clone();
  build_pyramid(second.image, &pyramid);
  EXPECT_NE(pyramid.level[2].data, level2);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), held.level[2].begin())) << "a holder's image changed";

  const std::uint8_t* mine = pyramid.level[1].data;
  build_pyramid(first.image, &pyramid);
  EXPECT_EQ(pyramid.level[1].data, mine);
}

}  // namespace
}  // namespace parallax
