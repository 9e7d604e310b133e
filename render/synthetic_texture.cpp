#include "render/synthetic_texture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"

namespace parallax {

cv::Size texture_size(double width_px, double height_px) {
  const auto round_up = [](double v) {
    return std::max(1, static_cast<int>(std::ceil(v / kTextureAlign))) * kTextureAlign;
  };
  return {round_up(width_px), round_up(height_px)};
}

Texture::Texture(const cv::Mat3b& picture) : width_(picture.cols), height_(picture.rows) {
  PARALLAX_CHECK(width_ > 0 && width_ % kTextureAlign == 0 && height_ % kTextureAlign == 0,
                 "a texture's sides are multiples of kTextureAlign");
  cv::Mat grey;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  cv::Mat level(picture.size(), CV_8UC4);
  const cv::Mat planes[] = {picture, grey};
  const int from_to[] = {0, 0, 1, 1, 2, 2, 3, 3};
  cv::mixChannels(planes, 2, &level, 1, from_to, 4);
  for (int i = 0; i < kTextureLevels; ++i) {
    Level& out = levels_[static_cast<std::size_t>(i)];
    out.scale = 1.0f / static_cast<float>(1 << i);
    cv::copyMakeBorder(level, out.colour, 1, 2, 1, 2, cv::BORDER_REPLICATE);
    cv::extractChannel(out.colour, out.grey, 3);
    if (i + 1 < kTextureLevels) {
      cv::Mat half;
      cv::resize(level, half, level.size() / 2, 0, 0, cv::INTER_AREA);
      level = half;
    }
  }
}

}  // namespace parallax
