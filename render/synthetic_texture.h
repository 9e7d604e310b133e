// A picture on a surface of a synthetic scene: BGR and grey, with a chain of half-size levels so that it can be sampled
// without aliasing at any distance.
//
// Texture coordinates: (0, 0) is the outer corner of the top-left texel of level 0, (width, height) the outer corner of
// the bottom-right one. Immutable once built; safe to sample from any thread.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace parallax {

inline constexpr int kTextureLevels = 6;
// Sides are multiples of this, so that every level is exactly half of the one below.
inline constexpr int kTextureAlign = 1 << (kTextureLevels - 1);

// The nearest size the texture can have: rounded up to whole multiples of kTextureAlign.
cv::Size texture_size(double width_px, double height_px);

class Texture {
 public:
  // The size must be what texture_size() gives (CHECK). Grey is 0.114 B + 0.587 G + 0.299 R, as OpenCV's.
  explicit Texture(const cv::Mat3b& picture);

  int width() const { return width_; }
  int height() const { return height_; }

  // Bilinear look-up at level 0 coordinates, which must lie within the texture; values 0..255. Channels == 1 gives
  // grey; Channels == 4 gives B, G, R, grey. The grey of both is the same to the last bit.
  template <int Channels>
  void sample(float s, float t, int level, float* out) const {
    static_assert(Channels == 1 || Channels == 4);
    const Level& l = levels_[static_cast<std::size_t>(level)];
    // Levels carry a border of one texel: index 0 is the border, so the centre of texel (0, 0) is at (1, 1).
    const float x = s * l.scale + 0.5f, y = t * l.scale + 0.5f;
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const cv::Mat& image = Channels == 1 ? l.grey : l.colour;
    const std::uint8_t* a =
        image.data + static_cast<std::size_t>(iy) * image.step[0] + static_cast<std::size_t>(ix * Channels);
    const std::uint8_t* b = a + image.step[0];
    for (int c = 0; c < Channels; ++c) {
      const float top = static_cast<float>(a[c]) + fx * static_cast<float>(a[c + Channels] - a[c]);
      const float bottom = static_cast<float>(b[c]) + fx * static_cast<float>(b[c + Channels] - b[c]);
      out[c] = top + fy * (bottom - top);
    }
  }

  // For loops of their own: a level's grey, with its border (see sample()), and the factor from level 0.
  const cv::Mat& grey(int level) const { return levels_[static_cast<std::size_t>(level)].grey; }
  float scale(int level) const { return levels_[static_cast<std::size_t>(level)].scale; }

 private:
  struct Level {
    cv::Mat grey;    // CV_8UC1 with border
    cv::Mat colour;  // CV_8UC4: B, G, R, grey, with border
    float scale = 1;
  };
  int width_ = 0, height_ = 0;
  std::array<Level, kTextureLevels> levels_;
};

}  // namespace parallax
