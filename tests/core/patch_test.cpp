#include "core/patch.h"

#include <gtest/gtest.h>

#include <climits>
#include <limits>

#include "core/fast.h"
#include "tests/core/kernel_images.h"

namespace parallax {
namespace {

int direct_zmssd(const PatchTemplate& t, const GreyImage& image, int x, int y) {
  double mean_image = 0, mean_template = 0, sum = 0;
  for (int j = 0; j < 8; ++j) {
    for (int i = 0; i < 8; ++i) {
      mean_image += image(y - 4 + j, x - 4 + i) / 64.0;
      mean_template += t.pixels[static_cast<std::size_t>(8 * j + i)] / 64.0;
    }
  }
  for (int j = 0; j < 8; ++j) {
    for (int i = 0; i < 8; ++i) {
      const double d =
          (image(y - 4 + j, x - 4 + i) - mean_image) - (t.pixels[static_cast<std::size_t>(8 * j + i)] - mean_template);
      sum += d * d;
    }
  }
  return static_cast<int>(std::floor(sum + 1e-7));
}

TEST(Zmssd, MatchesTheFormulaEverywhereAtEveryInstructionSet) {
  std::mt19937 random(8);
  for (const auto& [width, height, gap] : std::vector<std::array<int, 3>>{{8, 8, 0}, {23, 17, 0}, {19, 9, 6}}) {
    for (int kind = 0; kind < kImageKinds; ++kind) {
      ExactImage source(width, height, gap);
      fill_random(&source, kind, &random);
      PatchTemplate noise;
      for (auto& p : noise.pixels) p = static_cast<std::uint8_t>(random());
      finish_template(&noise);
      PatchTemplate own, flat, white, halves;
      ASSERT_TRUE(copy_patch(source.image, width / 2, height / 2, &own));
      flat.pixels.fill(100);
      white.pixels.fill(255);
      for (std::size_t k = 0; k < kPatchPixels; ++k) halves.pixels[k] = k % 8 < 4 ? 0 : 255;
      for (PatchTemplate* t : {&flat, &white, &halves}) finish_template(t);
      for (const PatchTemplate* t : {&noise, &own, &flat, &white, &halves}) {
        for (int y = 4; y <= height - 4; ++y) {
          for (int x = 4; x <= width - 4; ++x) {
            const int truth = direct_zmssd(*t, source.image, x, y);
            ASSERT_EQ(zmssd_scalar(*t, source.image, x, y), truth);
            for_each_simd_level([&] { ASSERT_EQ(zmssd(*t, source.image, x, y), truth) << x << "," << y; });
          }
        }
      }
      EXPECT_EQ(zmssd(own, source.image, width / 2, height / 2), 0);
    }
  }
}

TEST(Zmssd, IgnoresTheMeanAndReachesItsLargestValue) {
  ExactImage source(8, 8);
  source.fill([](int x, int) { return x < 4 ? 0 : 255; });
  PatchTemplate opposite, brighter;
  for (std::size_t k = 0; k < kPatchPixels; ++k) opposite.pixels[k] = k % 8 < 4 ? 255 : 0;
  finish_template(&opposite);
  ExactImage dim(8, 8);
  dim.fill([](int x, int y) { return 10 + 7 * x + 3 * y; });
  for (std::size_t k = 0; k < kPatchPixels; ++k)
    brighter.pixels[k] = static_cast<std::uint8_t>(90 + 7 * (k % 8) + 3 * (k / 8));
  finish_template(&brighter);
  for_each_simd_level([&] {
    EXPECT_EQ(zmssd(opposite, source.image, 4, 4), 64 * 255 * 255);
    EXPECT_EQ(zmssd(brighter, dim.image, 4, 4), 0);
  });
}

TEST(PatchTemplate, SumsAreThoseOfThePixels) {
  std::mt19937 random(9);
  PatchTemplate t;
  for (auto& p : t.pixels) p = static_cast<std::uint8_t>(random());
  t.pixels[3] = 255;
  finish_template(&t);
  int sum = 0, squares = 0;
  for (const int p : t.pixels) {
    sum += p;
    squares += p * p;
  }
  EXPECT_EQ(t.sum, sum);
  EXPECT_EQ(t.sum_squares, squares);
}

TEST(CopyPatch, CopiesTheBlockAndRefusesTheBorder) {
  ExactImage source(12, 10);
  source.fill([](int x, int y) { return 10 * y + x; });
  PatchTemplate t;
  ASSERT_TRUE(copy_patch(source.image, 4, 4, &t));
  EXPECT_EQ(t.pixels[0], 0);
  EXPECT_EQ(t.pixels[63], 77);
  ASSERT_TRUE(copy_patch(source.image, 8, 6, &t));
  EXPECT_EQ(t.pixels[63], 10 * 9 + 11);
  EXPECT_FALSE(copy_patch(source.image, 3, 4, &t));
  EXPECT_FALSE(copy_patch(source.image, 4, 3, &t));
  EXPECT_FALSE(copy_patch(source.image, 9, 6, &t));
  EXPECT_FALSE(copy_patch(source.image, 8, 7, &t));
}

TEST(BestZmssd, FindsWhatAnExhaustiveSearchOfTheCircleFinds) {
  std::mt19937 random(10);
  std::uniform_real_distribution<double> unit(0, 1);
  int found = 0, refused = 0;
  for (const auto& [width, height, gap] : std::vector<std::array<int, 3>>{{120, 60, 0}, {33, 21, 5}, {9, 9, 0}}) {
    for (int kind : {0, 1, 2}) {
      ExactImage source(width, height, gap);
      fill_random(&source, kind, &random);
      CornerList list;
      fast_corners(source.image, kind == 0 ? 0 : 8, &list);
      list.corners.shrink_to_fit();  // reads beyond the end show
      for (int trial = 0; trial < 60; ++trial) {
        PatchTemplate t;
        const int tx = 4 + static_cast<int>(unit(random) * (width - 8)),
                  ty = 4 + static_cast<int>(unit(random) * (height - 8));
        ASSERT_TRUE(copy_patch(source.image, tx, ty, &t));
        const double cx = tx + 20 * unit(random) - 10, cy = ty + 20 * unit(random) - 10;
        const double radius = trial == 0 ? 500 : trial % 3 == 0 ? std::floor(15 * unit(random)) : 15 * unit(random);
        const int threshold = static_cast<int>(trial % 2 == 0 ? 400000 * unit(random) : INT_MAX);
        int best = threshold, at_x = -7, at_y = -7;
        bool any = false;
        for (const Corner& c : list.corners) {
          if (c.x < 4 || c.y < 4 || c.x > width - 4 || c.y > height - 4) continue;
          if ((c.x - cx) * (c.x - cx) + (c.y - cy) * (c.y - cy) > radius * radius) continue;
          const int score = direct_zmssd(t, source.image, c.x, c.y);
          if (any ? score < best : score <= best) {
            best = score;
            at_x = c.x;
            at_y = c.y;
            any = true;
          }
        }
        ++(any ? found : refused);
        for_each_simd_level([&] {
          int x = -7, y = -7;
          const int score = best_zmssd(t, source.image, list, cx, cy, radius, threshold, &x, &y);
          EXPECT_EQ(x, at_x);
          EXPECT_EQ(y, at_y);
          if (any) {
            EXPECT_EQ(score, best);
          } else if (threshold < INT_MAX) {
            EXPECT_GT(score, threshold);
          }
        });
      }
    }
  }
  EXPECT_GT(found, 100);
  EXPECT_GT(refused, 50);
}

TEST(BestZmssd, TakesNoHarmFromNonsense) {
  ExactImage source(40, 40);
  std::mt19937 random(11);
  fill_random(&source, 1, &random);
  CornerList list;
  fast_corners(source.image, 10, &list);
  PatchTemplate t;
  ASSERT_TRUE(copy_patch(source.image, 20, 20, &t));
  const double nan = std::numeric_limits<double>::quiet_NaN(), huge = 1e300;
  for_each_simd_level([&] {
    int x = -7, y = -7;
    for (const auto& [cx, cy, r] : std::vector<std::array<double, 3>>{
             {nan, 20, 5}, {20, nan, 5}, {20, 20, nan}, {huge, 20, 5}, {20, -huge, 5}, {20, 20, -1}, {-100, -100, 5}}) {
      EXPECT_GT(best_zmssd(t, source.image, list, cx, cy, r, 1000000, &x, &y), 1000000);
    }
    EXPECT_EQ(x, -7);
    EXPECT_LT(best_zmssd(t, source.image, list, 20, 20, huge, 1000000000, &x, &y), 1000000000);
    EXPECT_GT(best_zmssd(t, source.image, CornerList{}, 20, 20, 5, 1000, &x, &y), 1000);
  });
}

Eigen::Matrix2d matrix(double a, double b, double c, double d) {
  Eigen::Matrix2d m;
  m << a, b, c, d;
  return m;
}

TEST(WarpPatch, IdentityIsACopyAndShiftsInterpolate) {
  std::mt19937 random(12);
  ExactImage source(30, 20, 3);
  fill_random(&source, 0, &random);
  for_each_simd_level([&] {
    PatchTemplate copied, warped;
    for (int y = 4; y <= 16; ++y) {
      for (int x = 4; x <= 26; ++x) {
        ASSERT_TRUE(copy_patch(source.image, x, y, &copied));
        ASSERT_TRUE(warp_patch(source.image, Eigen::Vector2d(x, y), Eigen::Matrix2d::Identity(), &warped))
            << x << "," << y;
        EXPECT_EQ(warped.pixels, copied.pixels);
        EXPECT_EQ(warped.sum, copied.sum);
        EXPECT_EQ(warped.sum_squares, copied.sum_squares);
      }
    }
    ASSERT_TRUE(warp_patch(source.image, {10.5, 8.25}, Eigen::Matrix2d::Identity(), &warped));
    for (int j = 0; j < 8; ++j) {
      for (int i = 0; i < 8; ++i) {
        const int x = 6 + i, y = 4 + j;
        const GreyImage& s = source.image;
        const double truth = 0.75 * 0.5 * (s(y, x) + s(y, x + 1)) + 0.25 * 0.5 * (s(y + 1, x) + s(y + 1, x + 1));
        EXPECT_NEAR(warped.pixels[static_cast<std::size_t>(8 * j + i)], truth, 0.5001);
      }
    }
  });
}

TEST(WarpPatch, IsExactOnALinearRamp) {
  ExactImage source(80, 60);
  source.fill([](int x, int y) { return 2 * x + y; });
  const Eigen::Vector2d centre(38.3, 27.8);
  const double s = std::sin(0.7), c = std::cos(0.7);
  for (const Eigen::Matrix2d& m : {matrix(1, 0, 0, 1), matrix(2, 0, 0, 2), matrix(0.5, 0, 0, 0.5), matrix(c, -s, s, c),
                                   matrix(1.3, 0.4, -0.2, 0.8), matrix(-1, 0, 0, 1), matrix(3, 1, -1, 2.5)}) {
    for_each_simd_level([&] {
      PatchTemplate t;
      AlignmentTemplate a;
      ASSERT_TRUE(warp_patch(source.image, centre, m, &t));
      ASSERT_TRUE(warp_alignment_template(source.image, centre, m, &a));
      for (int j = 0; j < 8; ++j) {
        for (int i = 0; i < 8; ++i) {
          const Eigen::Vector2d p = centre + m * Eigen::Vector2d(i - 4, j - 4);
          const double truth = 2 * p.x() + p.y();
          const auto k = static_cast<std::size_t>(8 * j + i);
          EXPECT_NEAR(t.pixels[k], truth, 0.501);
          EXPECT_NEAR(a.intensity[k], truth, 1e-3);
          EXPECT_NEAR(a.dx[k], 2 * m(0, 0) + m(1, 0), 1e-3);
          EXPECT_NEAR(a.dy[k], 2 * m(0, 1) + m(1, 1), 1e-3);
        }
      }
    });
  }
}

TEST(WarpPatch, GivesTheSameBitsAtEveryInstructionSet) {
  std::mt19937 random(13);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal(0, 1);
  int inside = 0, outside = 0;
  for (const auto& [width, height, gap] :
       std::vector<std::array<int, 3>>{{60, 40, 0}, {8, 8, 0}, {11, 10, 0}, {13, 12, 4}, {2, 2, 0}}) {
    ExactImage source(width, height, gap);
    fill_random(&source, 0, &random);
    for (int trial = 0; trial < 600; ++trial) {
      Eigen::Matrix2d m =
          matrix(1 + 0.3 * normal(random), 0.3 * normal(random), 0.3 * normal(random), 1 + 0.3 * normal(random));
      if (trial % 3 == 0) m = Eigen::Matrix2d::Identity();
      if (trial % 3 == 1) m *= 0.4;
      Eigen::Vector2d centre(unit(random) * width, unit(random) * height);
      if (trial % 4 == 0) centre = centre.array().round();
      PatchTemplate truth;
      AlignmentTemplate fine_truth;
      const bool ok = warp_patch_scalar(source.image, centre, m, &truth);
      const bool fine_ok = warp_alignment_template_scalar(source.image, centre, m, &fine_truth);
      ++(ok ? inside : outside);
      for_each_simd_level([&] {
        PatchTemplate t;
        AlignmentTemplate fine;
        ASSERT_EQ(warp_patch(source.image, centre, m, &t), ok);
        ASSERT_EQ(warp_alignment_template(source.image, centre, m, &fine), fine_ok);
        if (ok) {
          EXPECT_EQ(t.pixels, truth.pixels);
        }
        EXPECT_EQ(fine.valid, fine_truth.valid);
        if (fine_ok) {
          EXPECT_EQ(fine.intensity, fine_truth.intensity);
          EXPECT_EQ(fine.dx, fine_truth.dx);
          EXPECT_EQ(fine.dy, fine_truth.dy);
          EXPECT_EQ(fine.inverse_normal, fine_truth.inverse_normal);
        }
      });
    }
  }
  EXPECT_GT(inside, 500);
  EXPECT_GT(outside, 500);
}

TEST(WarpPatch, RefusesWhatLeavesTheImageAndNonsense) {
  ExactImage source(20, 20);
  const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for_each_simd_level([&] {
    PatchTemplate t;
    AlignmentTemplate a;
    EXPECT_TRUE(warp_patch(source.image, {4, 4}, one, &t));
    EXPECT_TRUE(warp_patch(source.image, {16, 16}, one, &t));
    EXPECT_FALSE(warp_patch(source.image, {3.99, 4}, one, &t));
    EXPECT_FALSE(warp_patch(source.image, {4, 3.99}, one, &t));
    EXPECT_FALSE(warp_patch(source.image, {16.01, 16}, one, &t));
    EXPECT_FALSE(warp_patch(source.image, {16, 16.01}, one, &t));
    EXPECT_FALSE(warp_patch(source.image, {10, 10}, 3 * one, &t));
    EXPECT_FALSE(warp_alignment_template(source.image, {4, 4}, one, &a));
    EXPECT_TRUE(warp_alignment_template(source.image, {5, 15}, one, &a));
    EXPECT_FALSE(a.valid) << "black";
    EXPECT_FALSE(warp_patch(source.image, {nan, 10}, one, &t));
    EXPECT_FALSE(warp_patch(source.image, {10, 10}, matrix(1, nan, 0, 1), &t));
    EXPECT_FALSE(warp_patch(source.image, {10, 10}, 1e30 * one, &t));
    EXPECT_FALSE(warp_patch(source.image, {1e300, 10}, one, &t));
    EXPECT_FALSE(warp_patch(GreyImage(), {10, 10}, one, &t));
  });
}

}  // namespace
}  // namespace parallax
