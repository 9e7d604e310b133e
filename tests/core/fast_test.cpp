#include "core/fast.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "tests/core/kernel_images.h"

namespace parallax {
namespace {

// By the definition, spelled out.
bool is_corner(const GreyImage& image, int x, int y, int threshold) {
  static constexpr int kX[16] = {0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1};
  static constexpr int kY[16] = {-3, -3, -2, -1, 0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3};
  if (x < 3 || y < 3 || x >= image.cols - 3 || y >= image.rows - 3) return false;
  for (int start = 0; start < 16; ++start) {
    bool bright = true, dark = true;
    for (int k = 0; k < 10; ++k) {
      const int at = (start + k) % 16, v = image(y + kY[at], x + kX[at]);
      bright = bright && v > image(y, x) + threshold;
      dark = dark && v < image(y, x) - threshold;
    }
    if (bright || dark) return true;
  }
  return false;
}

std::vector<Corner> naive_corners(const GreyImage& image, int threshold) {
  std::vector<Corner> found;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      if (is_corner(image, x, y, threshold))
        found.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
    }
  }
  return found;
}

void expect_rows_match(const CornerList& list, int height) {
  ASSERT_EQ(list.rows.size(), static_cast<std::size_t>(height) + 1);
  EXPECT_EQ(list.rows.front(), 0);
  EXPECT_EQ(list.rows.back(), static_cast<int>(list.corners.size()));
  for (int y = 0; y < height; ++y) {
    const auto row = static_cast<std::size_t>(y);
    ASSERT_LE(list.rows[row], list.rows[row + 1]);
    for (int k = list.rows[row]; k < list.rows[row + 1]; ++k) ASSERT_EQ(list.corners[static_cast<std::size_t>(k)].y, y);
  }
}

TEST(Fast, MatchesTheDefinitionAtEveryInstructionSetOnAwkwardSizes) {
  std::mt19937 random(3);
  std::size_t total = 0;
  CornerList list;  // one for all calls: what an earlier image left behind must not show
  for (const auto& [width, height, gap] : std::vector<std::array<int, 3>>{{160, 40, 0},
                                                                          {8, 8, 0},
                                                                          {7, 7, 0},
                                                                          {6, 20, 0},
                                                                          {20, 6, 0},
                                                                          {1, 1, 0},
                                                                          {21, 11, 3},
                                                                          {22, 9, 0},
                                                                          {23, 9, 0},
                                                                          {37, 12, 0},
                                                                          {38, 12, 1},
                                                                          {39, 12, 0},
                                                                          {69, 10, 0},
                                                                          {70, 10, 0},
                                                                          {71, 10, 9},
                                                                          {133, 20, 0},
                                                                          {134, 9, 0},
                                                                          {135, 9, 30}}) {
    for (int kind = 0; kind < kImageKinds; ++kind) {
      ExactImage source(width, height, gap);
      fill_random(&source, kind, &random);
      for (int threshold : {0, 1, 10, 60, 254, 255}) {
        const std::vector<Corner> truth = naive_corners(source.image, threshold);
        total += truth.size();
        CornerList scalar;
        fast_corners_scalar(source.image, threshold, &scalar);
        ASSERT_EQ(scalar.corners, truth) << width << "x" << height << " kind " << kind << " threshold " << threshold;
        expect_rows_match(scalar, height);
        for_each_simd_level([&, w = width, h = height] {
          fast_corners(source.image, threshold, &list);
          ASSERT_EQ(list.corners, truth) << w << "x" << h << " kind " << kind << " threshold " << threshold;
          EXPECT_EQ(list.rows, scalar.rows);
        });
      }
    }
  }
  EXPECT_GT(total, 5000u) << "the images hold too few corners to show anything";
}

TEST(Fast, TenInARowAreACornerAndNineAreNot) {
  for (int length = 8; length <= 16; ++length) {
    for (int start = 0; start < 16; ++start) {
      for (int sign : {-1, 1}) {
        static constexpr int kX[16] = {0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1};
        static constexpr int kY[16] = {-3, -3, -2, -1, 0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3};
        ExactImage source(80, 7);
        source.fill([](int, int) { return 100; });
        for (int k = 0; k < length; ++k) {
          const int at = (start + k) % 16;
          source.image(3 + kY[at], 40 + kX[at]) = static_cast<std::uint8_t>(100 + 21 * sign);
        }
        for_each_simd_level([&] {
          CornerList list;
          fast_corners(source.image, 20, &list);
          const bool found = std::find(list.corners.begin(), list.corners.end(), Corner{40, 3}) != list.corners.end();
          EXPECT_EQ(found, length >= 10) << length << " from " << start;
          EXPECT_EQ(fast_score(source.image, 40, 3), length >= 10 ? 20 : 0);
          fast_corners(source.image, 21, &list);
          EXPECT_TRUE(std::find(list.corners.begin(), list.corners.end(), Corner{40, 3}) == list.corners.end());
        });
      }
    }
  }
}

TEST(FastScore, IsTheLargestThresholdThatStillFindsTheCorner) {
  std::mt19937 random(4);
  int positive = 0;
  for (int kind = 0; kind < kImageKinds; ++kind) {
    ExactImage source(41, 23, 2);
    fill_random(&source, kind, &random);
    for_each_simd_level([&] {
      for (int y = 0; y < source.image.rows; ++y) {
        for (int x = 0; x < source.image.cols; ++x) {
          const int score = fast_score(source.image, x, y);
          ASSERT_GE(score, 0);
          ASSERT_FALSE(is_corner(source.image, x, y, score + 1)) << x << "," << y;
          if (score > 0) {
            ++positive;
            ASSERT_TRUE(is_corner(source.image, x, y, score)) << x << "," << y;
          }
        }
      }
    });
  }
  EXPECT_GT(positive, 100);
}

TEST(MaximalCorners, AreThoseWithoutABetterNeighbour) {
  std::mt19937 random(5);
  for (int kind = 0; kind < kImageKinds; ++kind) {
    ExactImage source(90, 60);
    fill_random(&source, kind, &random);
    for_each_simd_level([&] {
      CornerList list;
      fast_corners(source.image, 5, &list);
      const auto score_of = [&](int x, int y) {
        return is_corner(source.image, x, y, 5) ? fast_score(source.image, x, y) : -1;
      };
      std::vector<Corner> truth;
      for (const Corner& c : list.corners) {
        const int score = score_of(c.x, c.y);
        bool maximal = true;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            if (dx == 0 && dy == 0) continue;
            const int other = score_of(c.x + dx, c.y + dy);
            const bool earlier = dy < 0 || (dy == 0 && dx < 0);
            if (other > score || (earlier && other == score)) maximal = false;
          }
        }
        if (maximal) truth.push_back(c);
      }
      EXPECT_EQ(maximal_corners(source.image, list), truth);
      EXPECT_FALSE(truth.empty());
    });
  }
}

TEST(ShiTomasi, IsTheSmallerEigenvalueOfTheMeanGradientMatrix) {
  std::mt19937 random(6);
  ExactImage source(31, 19, 4);
  fill_random(&source, 2, &random);
  for (int half : {1, 3, 5}) {
    for (int y = 0; y < source.image.rows; ++y) {
      for (int x = 0; x < source.image.cols; ++x) {
        const bool inside =
            x > half && y > half && x + half + 1 < source.image.cols && y + half + 1 < source.image.rows;
        double truth = 0;
        if (inside) {
          Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
          for (int v = y - half; v <= y + half; ++v) {
            for (int u = x - half; u <= x + half; ++u) {
              const Eigen::Vector2d g(0.5 * (source.image(v, u + 1) - source.image(v, u - 1)),
                                      0.5 * (source.image(v + 1, u) - source.image(v - 1, u)));
              sum += g * g.transpose();
            }
          }
          sum /= (2 * half + 1) * (2 * half + 1);
          truth = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(sum).eigenvalues()[0];
        }
        for_each_simd_level([&] {
          EXPECT_NEAR(shi_tomasi_score(source.image, x, y, half), truth, 1e-5 * truth + 1e-4) << x << "," << y;
        });
      }
    }
  }
}

TEST(AdaptiveThreshold, SettlesNearTheTargetAndStaysThere) {
  std::mt19937 random(7);
  const WaveTexture texture(&random, 5.0, 40.0, 40, 35.0);
  std::normal_distribution<double> noise(0.0, 3.0);
  ExactImage source(320, 240);
  source.fill([&](int x, int y) { return texture(x, y) + noise(random); });
  const auto count = [&](int threshold) {
    CornerList list;
    fast_corners(source.image, threshold, &list);
    return static_cast<int>(list.corners.size());
  };
  for (int goal : {8, 12, 18}) {
    for (int start : {5, 10, 40}) {
      AdaptiveThreshold adaptive;
      adaptive.target = count(goal);
      adaptive.threshold = start;
      ASSERT_GT(adaptive.target, 20);
      int previous = start;
      for (int frame = 0; frame < 60; ++frame) {
        adaptive.update(count(adaptive.threshold));
        EXPECT_LE(std::abs(adaptive.threshold - previous), 4) << "a small step a frame";
        if (frame >= 40) {
          EXPECT_EQ(adaptive.threshold, previous) << "swings";
        }
        previous = adaptive.threshold;
      }
      const double ratio = count(adaptive.threshold) / static_cast<double>(adaptive.target);
      EXPECT_GT(ratio, 0.7) << goal << " from " << start;
      EXPECT_LT(ratio, 1.3) << goal << " from " << start;
    }
  }
}

TEST(AdaptiveThreshold, DoesNotSwingBetweenTwoThresholdsAndKeepsItsLimits) {
  // 10 finds half as many again as wanted, 11 half: no threshold is right, the nearer one is kept.
  AdaptiveThreshold adaptive;
  adaptive.target = 1000;
  adaptive.threshold = 7;
  for (int frame = 0; frame < 50; ++frame) adaptive.update(adaptive.threshold <= 10 ? 1500 : 400);
  const int settled = adaptive.threshold;
  adaptive.update(settled <= 10 ? 1500 : 400);
  EXPECT_EQ(adaptive.threshold, settled);

  for (int frame = 0; frame < 50; ++frame) adaptive.update(0);
  EXPECT_EQ(adaptive.threshold, adaptive.min_threshold);
  for (int frame = 0; frame < 50; ++frame) adaptive.update(1000000);
  EXPECT_EQ(adaptive.threshold, adaptive.max_threshold);
}

}  // namespace
}  // namespace parallax
