// What the stereo odometry takes from the images: corners, flow, right matches, and alignment on slanted surfaces. The
// texture is a sum of waves, so that where it went is exact to any part of a pixel.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "tests/support/statistics.h"
#include "tracker/affine_alignment.h"
#include "tracker/stereo_corners.h"
#include "tracker/stereo_flow.h"
#include "tracker/stereo_matching.h"

namespace parallax {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

class Waves {
 public:
  // With a period, all waves repeat along x after so many pixels.
  explicit Waves(unsigned seed, double period_px = 0) {
    std::mt19937 rng(seed);
    const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(rng); };
    for (int i = 0; i < 30; ++i) {
      const double length = 7 * std::pow(10.0, uniform(0, 1)), angle = uniform(0, std::numbers::pi);
      Wave w{2 * std::numbers::pi / length * Vector2d(std::cos(angle), std::sin(angle)), uniform(0, 6.3), 11};
      if (period_px > 0) {
        const double base = 2 * std::numbers::pi / period_px;
        w.frequency.x() = base * std::round(w.frequency.x() / base);
      }
      waves_.push_back(w);
    }
  }
  double at(const Vector2d& p) const {
    double sum = 128;
    for (const Wave& w : waves_) sum += w.size * std::sin(w.frequency.dot(p) + w.phase);
    return sum;
  }

 private:
  struct Wave {
    Vector2d frequency;
    double phase, size;
  };
  std::vector<Wave> waves_;
};

// An image whose pixel p shows the texture at texture_from_pixel(p).
GreyImage draw(const Waves& waves, cv::Size size, const std::function<Vector2d(const Vector2d&)>& texture_from_pixel,
               double gain = 1, double offset = 0) {
  GreyImage image(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      image(y, x) = cv::saturate_cast<uchar>(gain * waves.at(texture_from_pixel(Vector2d(x, y))) + offset);
  return image;
}

GreyImage draw_shifted(const Waves& waves, cv::Size size, const Vector2d& shift, double gain = 1, double offset = 0) {
  return draw(
      waves, size, [&](const Vector2d& p) { return Vector2d(p - shift); }, gain, offset);
}

ImagePyramid levels_of(const GreyImage& image) {
  ImagePyramid pyramid;
  build_pyramid(image, &pyramid);
  return pyramid;
}

const cv::Size kSize(320, 240);

TEST(StereoCorners, KeepTheirDistanceAndCoverTheImage) {
  const GreyImage image = draw_shifted(Waves(1), kSize, Vector2d::Zero());
  const std::vector<Vector2d> taken = {{100, 100}, {200.5, 60.25}, {31, 200}};
  CornerSearch search;
  search.wanted = 100;
  const auto corners = find_stereo_corners(image, taken, search);
  EXPECT_LE(corners.size() + taken.size(), 100u);
  EXPECT_GT(corners.size(), 60u);
  std::vector<Vector2d> all = taken;
  all.insert(all.end(), corners.begin(), corners.end());
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = std::max(i + 1, taken.size()); j < all.size(); ++j)
      EXPECT_GE((all[i] - all[j]).norm(), search.min_distance_px);
  std::vector<int> ninth(9, 0);
  for (const Vector2d& c : corners) {
    EXPECT_GE(std::min(c.x(), c.y()), search.border_px);
    EXPECT_LT(c.x(), kSize.width - search.border_px);
    EXPECT_LT(c.y(), kSize.height - search.border_px);
    ++ninth[static_cast<std::size_t>(3 * static_cast<int>(3 * c.y() / kSize.height) +
                                     static_cast<int>(3 * c.x() / kSize.width))];
  }
  EXPECT_GE(*std::min_element(ninth.begin(), ninth.end()), 3);
  EXPECT_LE(*std::max_element(ninth.begin(), ninth.end()), 25);
}

TEST(StereoCorners, BestOfAPartComeFirst) {
  // Grey, with a weak spot and a strong one within one part of the image.
  GreyImage image(kSize, 100);
  image(cv::Rect(130, 60, 9, 9)).setTo(125);
  image(cv::Rect(170, 60, 9, 9)).setTo(220);
  CornerSearch search;
  search.wanted = 10;
  const auto corners = find_stereo_corners(image, {}, search);
  ASSERT_GE(corners.size(), 2u);
  EXPECT_LT((corners[0] - Vector2d(174, 64)).norm(), 8);
}

TEST(StereoCorners, NoneWhereThereIsNothing) {
  EXPECT_TRUE(find_stereo_corners(GreyImage(kSize, 128), {}, {}).empty());
  GreyImage edge(kSize, 80);
  edge(cv::Rect(160, 0, 160, 240)).setTo(160);  // an edge is no corner
  EXPECT_TRUE(find_stereo_corners(edge, {}, {}).empty());
  EXPECT_TRUE(find_stereo_corners(GreyImage(20, 20, 128), {}, {}).empty());
  const GreyImage image = draw_shifted(Waves(1), kSize, Vector2d::Zero());
  CornerSearch search;
  search.wanted = 2;
  EXPECT_TRUE(find_stereo_corners(image, {{10, 10}, {50, 50}}, search).empty());
}

struct Flow {
  std::vector<double> errors;
  int asked = 0;
};

// Of corners of the texture, moved by `shift` and looked for where they were.
Flow follow(const Vector2d& shift, double gain, double offset) {
  const Waves waves(2);
  const GreyImage image = draw_shifted(waves, kSize, Vector2d::Zero());
  const ImagePyramid last = levels_of(image), next = levels_of(draw_shifted(waves, kSize, shift, gain, offset));
  CornerSearch search;
  search.wanted = 120;
  search.border_px = 40;
  Flow flow;
  for (const Vector2d& corner : find_stereo_corners(image, {}, search)) {
    ++flow.asked;
    if (const auto found = track_forward_backward(last, next, corner, corner, {}))
      flow.errors.push_back((*found - (corner + shift)).norm());
  }
  return flow;
}

TEST(StereoFlow, SubPixelUnderChangesOfBrightness) {
  struct Case {
    Vector2d shift;
    double gain, offset, found;
  };
  for (const Case& c : {Case{{0.5, -0.25}, 1, 0, 0.95}, Case{{6.37, -4.62}, 1, 0, 0.9}, Case{{3.3, 2.7}, 1, 20, 0.9},
                        Case{{3.3, 2.7}, 1.1, 0, 0.9}, Case{{-12.4, 9.1}, 1, 5, 0.6}}) {
    const Flow flow = follow(c.shift, c.gain, c.offset);
    ASSERT_GT(flow.asked, 50);
    EXPECT_GE(static_cast<double>(flow.errors.size()), c.found * flow.asked) << c.shift.transpose();
    // The 8x8 windows take up the mean alone; a gain is left in them.
    EXPECT_LT(testing::median(flow.errors), c.gain == 1 ? 0.06 : 0.13) << c.shift.transpose() << " gain " << c.gain;
    EXPECT_LT(*std::max_element(flow.errors.begin(), flow.errors.end()), 1) << c.shift.transpose();
  }
}

TEST(StereoFlow, WhatHasLeftIsNotFound) {
  const Waves waves(3);
  const ImagePyramid last = levels_of(draw_shifted(waves, kSize, Vector2d::Zero()));
  const ImagePyramid next = levels_of(draw_shifted(waves, kSize, {30, 0}));
  int found = 0;
  for (int y = 20; y < 220; y += 4)
    found += track_forward_backward(last, next, {305, y}, Vector2d(335, y), {}).has_value();
  EXPECT_EQ(found, 0);
  // Something else is there now.
  const ImagePyramid other = levels_of(draw_shifted(Waves(4), kSize, Vector2d::Zero()));
  int asked = 0;
  for (int y = 30; y < 210; y += 9)
    for (int x = 30; x < 290; x += 13, ++asked)
      found += track_forward_backward(last, other, Vector2d(x, y), Vector2d(x, y), {}).has_value();
  EXPECT_LE(found, 0.04 * asked);
}

TEST(StereoMatching, DisparityIsFoundToAPartOfAPixel) {
  const Waves waves(5);
  const double disparity = 17.3;
  const GreyImage left = draw_shifted(waves, kSize, Vector2d::Zero());
  const GreyImage right = draw_shifted(waves, kSize, {-disparity, 0}, 1.05, 4);
  const cv::Mat1f left_smooth = smooth_for_alignment(left), right_smooth = smooth_for_alignment(right);
  CornerSearch corner_search;
  corner_search.border_px = 40;
  RowSearch search;
  search.max_disparity_px = 60;
  std::vector<double> errors;
  int asked = 0;
  for (const Vector2d& corner : find_stereo_corners(left, {}, corner_search)) {
    ++asked;
    const auto row = search_row(left, right, corner, search);
    if (!row) continue;
    EXPECT_NEAR(*row, corner.x() - disparity, 1.5);
    AffineTemplate window;
    if (!window.prepare(left_smooth, corner)) continue;
    const auto match = align_right(window, right_smooth, *row, corner.y(), Matrix2d::Identity(), search);
    if (match) errors.push_back(std::abs(match->x - (corner.x() - disparity)));
  }
  ASSERT_GT(asked, 50);
  EXPECT_GT(static_cast<double>(errors.size()), 0.85 * asked);
  EXPECT_LT(testing::median(errors), 0.02);
  EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.15);
}

TEST(StereoMatching, WhatRepeatsOrIsAbsentOrInAnotherRowIsRefused) {
  const Waves repeated(6, 16), once(6);
  const GreyImage left = draw_shifted(repeated, kSize, Vector2d::Zero());
  const GreyImage right = draw_shifted(repeated, kSize, {-21.5, 0});
  const GreyImage blank(kSize, 90), plain = draw_shifted(once, kSize, Vector2d::Zero());
  const GreyImage lower = draw_shifted(once, kSize, {-9, 3});
  const cv::Mat1f plain_smooth = smooth_for_alignment(plain), lower_smooth = smooth_for_alignment(lower);
  RowSearch search;
  search.max_disparity_px = 60;
  CornerSearch corner_search;
  corner_search.border_px = 70;
  int asked = 0, found = 0;
  for (const Vector2d& corner : find_stereo_corners(left, {}, corner_search)) {
    ++asked;
    found += search_row(left, right, corner, search).has_value();
    EXPECT_FALSE(search_row(left, blank, corner, search));
    EXPECT_FALSE(search_row(left, right, {corner.x(), 1}, search));
    AffineTemplate window;
    ASSERT_TRUE(window.prepare(plain_smooth, corner));
    EXPECT_FALSE(align_right(window, lower_smooth, corner.x() - 9, corner.y(), Matrix2d::Identity(), search));
  }
  ASSERT_GT(asked, 10);
  EXPECT_EQ(found, 0);
}

// A window on a slanted surface, seen again from elsewhere. Where the window grows more than affinely the position is
// drawn that way, unless the perspective is told.
TEST(AffineAlignment, PerspectiveTakesTheBiasAway) {
  std::mt19937 rng(8);
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(rng); };
  double bias_with = 0, bias_without = 0, with = 0, without = 0;
  int windows = 0;
  for (unsigned i = 0; i < 120; ++i) {
    const Waves waves(100 + i);
    const double angle = uniform(0, 2 * std::numbers::pi);
    const Vector2d direction(std::cos(angle), std::sin(angle)), h = 0.01 * direction;
    const Matrix2d linear =
        Matrix2d::Identity() +
        (Matrix2d() << uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1)).finished();
    const Vector2d there(32 + uniform(-1, 1), 32 + uniform(-1, 1));
    const Matrix2d inverse = linear.inverse();
    const cv::Size small(64, 64);
    const GreyImage first = draw_shifted(waves, small, {32, 32});
    const GreyImage second = draw(waves, small, [&](const Vector2d& p) {
      const Vector2d e = inverse * (p - there);
      return Vector2d(e / (1 - h.dot(e)));
    });
    AffineTemplate window;
    ASSERT_TRUE(window.prepare(smooth_for_alignment(first), {32, 32}));
    const cv::Mat1f smooth = smooth_for_alignment(second);
    const auto told = window.align(smooth, {32, 32}, Matrix2d::Identity(), true, 20, h);
    const auto untold = window.align(smooth, {32, 32}, Matrix2d::Identity(), true, 20);
    if (!told.converged || !untold.converged) continue;
    ++windows;
    bias_with += (told.position - there).dot(direction);
    bias_without += (untold.position - there).dot(direction);
    with += (told.position - there).norm();
    without += (untold.position - there).norm();
    EXPECT_LT((told.linear - linear).norm(), 0.05);
  }
  ASSERT_GT(windows, 100);
  RecordProperty("bias_px", std::to_string(bias_with / windows) + " without " + std::to_string(bias_without / windows));
  RecordProperty("error_px", std::to_string(with / windows) + " without " + std::to_string(without / windows));
  EXPECT_LT(std::abs(bias_with / windows), 0.02);
  EXPECT_GT(std::abs(bias_without), 5 * std::abs(bias_with));
  EXPECT_LT(with, without / 2);
}

}  // namespace
}  // namespace parallax
