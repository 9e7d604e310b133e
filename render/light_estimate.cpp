#include "render/light_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"

namespace parallax {
namespace {

constexpr int kColumns = 40, kRows = 30;  // pixels looked at
constexpr float kMiddleGrey = 0.18f;      // linear level that exposure aims at for an average scene
constexpr float kDarkest = 0.02f, kBrightest = 1.3f;
constexpr float kMostTint = 2.0f;    // a colour channel against the mean: walls are coloured, light hardly
constexpr float kSmoothing = 0.12f;  // a frame: half a second at 30 frames/s brings 86 percent

const std::array<float, 256>& linear_levels() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> out{};
    for (int i = 0; i < 256; ++i) {
      const float c = static_cast<float>(i) / 255.0f;
      out[i] = c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);
    }
    return out;
  }();
  return table;
}

}  // namespace

Eigen::Vector3f LightEstimate::update(const cv::Mat& image) {
  if (image.empty()) return light_;
  PARALLAX_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3, "the light is estimated from a grey or BGR image");
  const auto& linear = linear_levels();
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int row = 0; row < kRows; ++row) {
    const int y = (2 * row + 1) * image.rows / (2 * kRows);
    for (int column = 0; column < kColumns; ++column) {
      const int x = (2 * column + 1) * image.cols / (2 * kColumns);
      if (image.channels() == 1) {
        sum.array() += linear[image.at<unsigned char>(y, x)];
      } else {
        const cv::Vec3b bgr = image.at<cv::Vec3b>(y, x);
        sum += Eigen::Vector3f(linear[bgr[2]], linear[bgr[1]], linear[bgr[0]]);
      }
    }
  }
  const Eigen::Vector3f mean = sum / static_cast<float>(kColumns * kRows);
  const float grey = mean.mean();
  const float level = std::clamp(grey / kMiddleGrey, kDarkest, kBrightest);
  Eigen::Vector3f now = Eigen::Vector3f::Constant(level);
  if (grey > 1e-4f) {
    // Half of the tint in a picture is taken to be the light's, half the things' own.
    now = level * (mean / grey).array().sqrt().cwiseMax(1 / kMostTint).cwiseMin(kMostTint).matrix();
  }
  light_ = started_ ? Eigen::Vector3f(light_ + kSmoothing * (now - light_)) : now;
  started_ = true;
  return light_;
}

}  // namespace parallax
