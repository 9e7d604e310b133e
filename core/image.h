// Grey images, the four-level pyramid (PTAM §4, §5.1) and pixel conversions between its levels.
//
// Pixels: the centre of the top-left pixel is (0, 0). Level l to level 0: (x + 0.5) * 2^l - 0.5.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>

namespace parallax {

using GreyImage = cv::Mat1b;

inline constexpr int kPyramidLevels = 4;  // PTAM §4

inline constexpr double level_scale(int level) { return static_cast<double>(1 << level); }

inline Eigen::Vector2d level_to_level0(const Eigen::Vector2d& px, int level) {
  const double s = level_scale(level);
  return ((px.array() + 0.5) * s - 0.5).matrix();
}
inline Eigen::Vector2d level0_to_level(const Eigen::Vector2d& px, int level) {
  const double s = level_scale(level);
  return ((px.array() + 0.5) / s - 0.5).matrix();
}

// Four levels, each half the size of the one below (2x2 box average, rounded; odd last rows and columns are dropped).
// The images are owned (reference-counted by cv::Mat) and never change once built.
struct ImagePyramid {
  std::array<GreyImage, kPyramidLevels> level;
  int width() const { return level[0].cols; }
  int height() const { return level[0].rows; }
};

// Builds the pyramid. `level0` is shared, not copied: the caller must not write to it afterwards. Reuses the
// allocations of `pyramid`'s upper levels when nobody else refers to them.
void build_pyramid(const GreyImage& level0, ImagePyramid* pyramid);

}  // namespace parallax
