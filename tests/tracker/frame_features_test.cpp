#include "tracker/frame_features.h"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <opencv2/core.hpp>
#include <set>
#include <vector>

namespace parallax {
namespace {

GreyImage picture(int seed) {
  GreyImage grey(120, 160);
  cv::RNG rng(static_cast<std::uint64_t>(seed));
  rng.fill(grey, cv::RNG::UNIFORM, 0, 256);
  return grey;
}

// Everything in a frame, by value.
struct Copy {
  std::array<GreyImage, kPyramidLevels> level;
  std::array<std::vector<Corner>, kPyramidLevels> corners;
  cv::Mat1f small;
  explicit Copy(const FrameImages& f) : small(f.small.image.clone()) {
    for (std::size_t l = 0; l < kPyramidLevels; ++l) {
      level[l] = f.pyramid.level[l].clone();
      corners[l] = f.corners[l].corners;
    }
  }
  bool same(const FrameImages& f) const {
    for (std::size_t l = 0; l < kPyramidLevels; ++l)
      if (cv::norm(level[l], f.pyramid.level[l], cv::NORM_INF) != 0 || corners[l] != f.corners[l].corners) return false;
    return cv::norm(small, f.small.image, cv::NORM_INF) == 0;
  }
};

TEST(FrameFeatures, ComputesEveryLevel) {
  FrameFeatures features(160, 120, TrackerOptions());
  const GreyImage grey = picture(1);
  const auto f = features.compute(grey);
  EXPECT_EQ(f->pyramid.width(), 160);
  EXPECT_EQ(f->pyramid.level[3].cols, 20);
  EXPECT_EQ(cv::norm(f->pyramid.level[0], grey, cv::NORM_INF), 0);
  EXPECT_FALSE(f->corners[0].corners.empty());
  for (std::size_t l = 0; l < kPyramidLevels; ++l)
    EXPECT_EQ(static_cast<int>(f->corners[l].rows.size()), f->pyramid.level[l].rows + 1);
  EXPECT_FALSE(f->small.empty());
}

TEST(FrameFeatures, FramesThatNobodyHoldsAreUsedAgain) {
  FrameFeatures features(160, 120, TrackerOptions());
  std::set<const FrameImages*> used;
  std::shared_ptr<const FrameImages> last;
  for (int i = 0; i < 10; ++i) {
    auto f = features.compute(picture(i));
    EXPECT_NE(f, last);
    used.insert(f.get());
    last = f;
  }
  EXPECT_LE(used.size(), 2U);
}

TEST(FrameFeatures, AFrameThatIsHeldIsNotTouched) {
  FrameFeatures features(160, 120, TrackerOptions());
  const auto held = features.compute(picture(100));
  const Copy copy(*held);
  for (int i = 0; i < 6; ++i) {
    EXPECT_NE(features.compute(picture(i)), held);
    EXPECT_TRUE(copy.same(*held));
  }
}

TEST(FrameFeatures, AFrameGivenAwayIsNeverWrittenAgain) {
  FrameFeatures features(160, 120, TrackerOptions());
  auto own = features.compute(picture(100));
  const FrameImages* given = own.get();
  const Copy copy(*own);
  features.give_away(own);
  // The other thread's reference alone, and behind an alias as a snapshot of its pyramid.
  const std::shared_ptr<const ImagePyramid> alias(own, &own->pyramid);
  own.reset();
  for (int i = 0; i < 6; ++i) {
    const auto f = features.compute(picture(i));
    EXPECT_NE(f.get(), given);
    EXPECT_TRUE(copy.same(*given));
  }
  EXPECT_EQ(alias.use_count(), 1) << "the pool has let go of it: the last holder frees it";
  // Given away twice, or unknown: nothing happens.
  features.give_away(std::make_shared<FrameImages>());
}

TEST(FrameFeatures, PartsOfAFrameThatAreStillHeldAreNotTouched) {
  FrameFeatures features(160, 120, TrackerOptions());
  auto f = features.compute(picture(100));
  const Copy copy(*f);
  // Somebody keeps the pixels, not the frame.
  const ImagePyramid pyramid = f->pyramid;
  const SmallBlurryImage small = f->small;
  f.reset();
  for (int i = 0; i < 4; ++i) features.compute(picture(i));
  for (std::size_t l = 0; l < kPyramidLevels; ++l)
    EXPECT_EQ(cv::norm(pyramid.level[l], copy.level[l], cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(small.image, copy.small, cv::NORM_INF), 0);
}

TEST(FrameFeatures, ThresholdsAdaptToTheTarget) {
  TrackerOptions options;
  FrameFeatures features(160, 120, options);
  const double target = options.corner_targets[0] * 160.0 * 120.0 / (640.0 * 480.0);
  // Texture of many strengths, so that the number of corners answers to the threshold.
  GreyImage grey(120, 160, static_cast<std::uint8_t>(100));
  cv::RNG rng(5);
  for (int i = 0; i < 400; ++i) {
    const cv::Point at(rng.uniform(0, 156), rng.uniform(0, 116));
    grey(cv::Rect(at, cv::Size(4, 4))) = static_cast<std::uint8_t>(100 + rng.uniform(-35, 35));
  }
  std::size_t found = 0;
  for (int i = 0; i < 60; ++i) found = features.compute(grey)->corners[0].corners.size();
  EXPECT_GT(static_cast<double>(found), 0.5 * target);
  EXPECT_LT(static_cast<double>(found), 2.0 * target);
}

}  // namespace
}  // namespace parallax
