#include "render/light_estimate.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "core/check.h"

namespace parallax {
namespace {

// sRGB 118 is 18 percent of white: a scene exposed as usual.
constexpr int kUsual = 118;

TEST(LightEstimate, IsOneForAnEvenlyExposedScene) {
  LightEstimate estimate;
  const Eigen::Vector3f light = estimate.update(cv::Mat1b(240, 320, kUsual));
  EXPECT_LT((light - Eigen::Vector3f::Ones()).cwiseAbs().maxCoeff(), 0.03f);
}

TEST(LightEstimate, FollowsBrightAndDark) {
  LightEstimate bright, dark, black;
  EXPECT_GT(bright.update(cv::Mat1b(240, 320, 150)).x(), 1.15f);
  EXPECT_LT(bright.update(cv::Mat1b(240, 320, 255)).x(), 1.5f) << "a white wall does not make things glow";
  // sRGB 40 is 2.1 percent: an eighth and a bit of the usual light.
  EXPECT_NEAR(dark.update(cv::Mat1b(240, 320, 40)).x(), 0.0212f / 0.18f, 0.01f);
  const float least = black.update(cv::Mat1b(240, 320, static_cast<unsigned char>(0))).x();
  EXPECT_GT(least, 0);
  EXPECT_LT(least, 0.05f);
}

TEST(LightEstimate, TakesOnTheTint) {
  LightEstimate warm;
  const Eigen::Vector3f light = warm.update(cv::Mat3b(240, 320, cv::Vec3b(70, 110, 150)));  // BGR
  EXPECT_GT(light.x(), 1.2f * light.y());
  EXPECT_GT(light.y(), 1.2f * light.z());
  LightEstimate grey;
  const Eigen::Vector3f none = grey.update(cv::Mat3b(240, 320, cv::Vec3b(90, 90, 90)));
  EXPECT_NEAR(none.x(), none.z(), 1e-4f);
}

TEST(LightEstimate, IsNotMovedByNoise) {
  cv::RNG random(5);
  LightEstimate estimate;
  float low = 10, high = 0;
  for (int frame = 0; frame < 60; ++frame) {
    cv::Mat1b image(240, 320);
    for (auto& px : image) px = cv::saturate_cast<unsigned char>(kUsual + random.gaussian(12));
    const float light = estimate.update(image).y();
    low = std::min(low, light);
    high = std::max(high, light);
  }
  EXPECT_LT(high - low, 0.03f);
  EXPECT_NEAR(0.5f * (low + high), 1, 0.06f);
}

TEST(LightEstimate, ChangesSmoothly) {
  LightEstimate estimate;
  const cv::Mat1b usual(240, 320, kUsual), dark(240, 320, 40);
  estimate.update(usual);
  float before = 1;
  for (int frame = 0; frame < 15; ++frame) {  // half a second
    const float light = estimate.update(dark).x();
    EXPECT_LT(light, before);
    EXPECT_GT(light, before - 0.15f);
    before = light;
  }
  EXPECT_LT(before, 0.3f);
}

TEST(LightEstimate, RefusesOtherImages) {
  LightEstimate estimate;
  EXPECT_THROW(estimate.update(cv::Mat(10, 10, CV_16UC1, cv::Scalar(0))), CheckFailure);
  EXPECT_EQ(estimate.update(cv::Mat()), Eigen::Vector3f::Ones()) << "no image: no news";
}

}  // namespace
}  // namespace parallax
